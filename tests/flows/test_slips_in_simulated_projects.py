"""Slips made on purpose in simulated projects are named; projects without a slip raise no suspicion.

The same slips in real deliveries: tests/golden/test_bad_input_on_real_data.py.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.geometry import rotation
from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.stories.examination import examine_everything
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tasks.store.store import Store
from tests.flows.adjustment_alone import adjustment_alone
from tests.grids import diagonal_daily

# Undulations of the geoid, metres: India and New Guinea are further out, Germany has 34 to 51.
UNDULATIONS = (-30.0, 48.0)
OMEGA_PHI_KAPPA = "project.angles=omega-phi-kappa"
HEADINGS = "project.angles=heading-pitch-roll"
CONVENTIONS = (HEADINGS, OMEGA_PHI_KAPPA)
ANGLES = ("heading", "pitch", "roll", "omega", "phi", "kappa")
# Presets with fewer points, and fewer images where there are many.
PRESETS: Mapping[str, tuple[str, ...]] = {
    "uce-high": ("points.count=300",),
    "uce-low": (
        "flight.0.lines=2",
        "flight.0.exposures=6",
        "flight.1.lines=1",
        "flight.1.exposures=6",
        "points.count=300",
    ),
    "uce-calibration": ("points.count=600",),
    "dmc-burn-in": ("points.count=300",),
    "dmc-20cm": ("points.count=400",),
    "dmc2-140": ("points.count=400",),
    "dmc2-250": ("points.count=400",),
    "ucx-20cm": ("points.count=400",),
    "ucx-8cm": ("points.count=600",),
    "rmk-8cm": ("flight.0.lines=3", "flight.0.exposures=8", "points.count=300"),
}
LEVER_ARM = (0.35, -0.12, -1.20)

#: For what does not depend on how the angles are counted.
BY_OPK_DAILY = (pytest.param(HEADINGS, marks=pytest.mark.slow), OMEGA_PHI_KAPPA)
BY_HEADINGS_DAILY = (HEADINGS, pytest.param(OMEGA_PHI_KAPPA, marks=pytest.mark.slow))
#: A quarter turn, which headings and κ count in opposite directions, and the half turn, which looks level.
TURNED_DAILY = ((HEADINGS, 90), (OMEGA_PHI_KAPPA, 180))

Edit = Callable[[pd.DataFrame], pd.DataFrame]


def simulated(folder: Path, preset: str, *changes: str) -> Path:
    simulate_project(load_simulation(preset, (*PRESETS[preset], *changes)), folder)
    return folder


def examined(project: Path, out: Path, *overrides: str) -> str:
    """All that ``aerocal doctor`` has to say, the message of a refusal included."""
    store = Store.of(out)
    store.begin_run()
    found = examine_everything(load_project(project / "project.toml", overrides), store)
    if found.refusal is not None:
        return str(found.refusal)
    problems = [problem for finding in found.findings for problem in finding.problems]
    return "\n".join([*problems, *(mistake.what for mistake in found.mistakes)])


@pytest.fixture(scope="module", params=CONVENTIONS)
def block(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """28 images in four crossing strips, forward and reverse."""
    return simulated(tmp_path_factory.mktemp("block"), "uce-high", request.param)


@pytest.fixture
def named(tmp_path: Path) -> Callable[..., str]:
    """What is said of a project whose exposures were changed."""

    def examine(project: Path, edit: Edit, *overrides: str) -> str:
        folder = Path(shutil.copytree(project, tmp_path / "project"))
        table = pd.read_csv(folder / "exposures.csv", dtype={"strip": str, "flight": str})
        edit(table).to_csv(folder / "exposures.csv", index=False)
        return examined(folder, tmp_path / "out", *overrides)

    return examine


@pytest.mark.parametrize(
    ("block", "undulation"), diagonal_daily(CONVENTIONS, UNDULATIONS), indirect=["block"]
)
def test_orthometric_heights_of_the_exposures(block: Path, named, undulation: float) -> None:
    said = named(block, lambda table: table.assign(z=table["z"] - undulation))
    assert "different height systems (geoid undulation?)" in said
    # The simulated GNSS has a shift of 0.286 m, the intersections of raw orientations a scatter of 0.4 m.
    number = float(said.split(" surveyed points come out ")[1].split(" m ")[0])
    assert number == pytest.approx(abs(undulation), abs=0.7)
    assert f" m {'lower' if undulation > 0.0 else 'higher'} than given" in said
    assert "Check `heights`" in said


@pytest.mark.parametrize("block", BY_OPK_DAILY, indirect=True)
def test_orthometric_heights_are_told_by_a_single_control_point(block: Path, named, tmp_path: Path) -> None:
    one = Path(shutil.copytree(block, tmp_path / "one"))
    control = pd.read_csv(one / "control.csv")
    control[control["point"] == control["point"].iloc[40]].to_csv(one / "control.csv", index=False)
    said = named(one, lambda table: table.assign(z=table["z"] - 30.0))
    assert "different height systems" in said
    assert "the one surveyed point comes out 30." in said or "the one surveyed point comes out 29." in said


@pytest.mark.parametrize("limit", [pytest.param(11, marks=pytest.mark.slow), 12])
@pytest.mark.parametrize("block", BY_OPK_DAILY, indirect=True)
def test_wherever_the_limit_of_control_lies_heights_are_named_as_heights(
    block: Path, named, limit: int
) -> None:
    """Scattered about the limit some points lie beyond it and some do not: no single point is to blame."""
    said = named(block, lambda table: table.assign(z=table["z"] - 12.0), f"checks.control_distance_m={limit}")
    assert "different height systems (geoid undulation?)" in said
    assert "control point" not in said


@pytest.mark.parametrize("block", BY_OPK_DAILY, indirect=True)
@pytest.mark.parametrize("shift_m", [3.0, pytest.param(20.0, marks=pytest.mark.slow), 200.0])
def test_positions_in_another_datum_are_named(block: Path, named, shift_m: float) -> None:
    """The GNSS shift takes what is below the limit of control points; beyond it no point is to blame."""
    said = named(block, lambda table: table.assign(x=table["x"] + shift_m))
    assert "different datums" in said
    found = re.search(r"84 surveyed points come out ([\d.]+) m (?:east|north)", said)
    assert found is not None
    assert float(found[1]) == pytest.approx(shift_m, abs=0.7)
    assert "control point C" not in said


def test_feet_and_us_survey_feet_are_told_apart_by_large_coordinates(tmp_path: Path) -> None:
    folder = simulated(
        tmp_path / "utm", "uce-high", "project.crs=EPSG:25832", "project.latitude_deg=48.9",
        "project.longitude_deg=9.6",
    )  # fmt: skip
    control = pd.read_csv(folder / "control.csv", dtype={"point": str})
    control[["x", "y", "z"]] /= 0.3048
    control.to_csv(folder / "control.csv", index=False)
    # 2 ppm of 5,400 km.
    said = examined(folder, tmp_path / "out", "inputs.control.length_unit=us-ft")
    assert re.search(r"84 surveyed points come out .*1[01]\.\d m south", said)
    assert "us-ft" in said


@pytest.mark.parametrize("block", BY_OPK_DAILY, indirect=True)
def test_heights_that_no_geoid_explains_are_not_called_an_undulation(block: Path, tmp_path: Path) -> None:
    """Of a run; the doctor tries the units, too."""
    folder = Path(shutil.copytree(block, tmp_path / "project"))
    table = pd.read_csv(folder / "exposures.csv", dtype={"strip": str, "flight": str})
    table.assign(z=table["z"] / 0.3048).to_csv(folder / "exposures.csv", index=False)
    outcome = carry_out(adjustment_alone, RunRequest(folder / "project.toml"))
    assert "geoid undulation" not in str(outcome.error)
    assert "height_unit" in str(outcome.error)


def in_gon(table: pd.DataFrame) -> pd.DataFrame:
    columns = [name for name in ANGLES if name in table]
    return table.assign(**{name: table[name] / 0.9 for name in columns})


# ω, φ, κ in gon: tests/flows/test_wrong_deliveries.py.
@pytest.mark.parametrize("block", BY_HEADINGS_DAILY, indirect=True)
def test_angles_in_gon(block: Path, named) -> None:
    assert 'eclare angles.unit = "gon"' in named(block, in_gon)


@pytest.mark.parametrize("attitude_deg", [pytest.param(0.3, marks=pytest.mark.slow), 1.0])
def test_angles_in_gon_of_strips_to_the_north(tmp_path: Path, named, attitude_deg: float) -> None:
    """Headings near zero are nearly the same in gon; roll and pitch show it, by ten to a hundred pixels."""
    north = (
        "flight.0.heading_deg=4",
        "flight.0.directions=single",
        "trajectory.crab_deg=0.5",
        f"trajectory.attitude_deg=[{attitude_deg}, {attitude_deg}, 0.5]",
        HEADINGS,
    )
    project = simulated(tmp_path / "north", "dmc-burn-in", *north)
    said = named(project, in_gon)
    assert "The angles look like gon" in said
    assert 'Declare angles.unit = "gon"' in said
    assert "image W" not in said


def in_other_order(folder: Path, declared: str, tilt_deg: float, out: Path) -> RunOutcome:
    """A run with angles of another order than the declared one."""
    tilts = f"trajectory.attitude_deg=[{tilt_deg}, {tilt_deg}, 1.5]"
    project = simulated(folder, "uce-high", OMEGA_PHI_KAPPA, tilts)
    if declared == "omega-phi-kappa":
        table, columns = pd.read_csv(project / "exposures.csv"), ["omega", "phi", "kappa"]
        matrix = rotation.from_omega_phi_kappa(np.deg2rad(table[columns].to_numpy()))
        table[columns] = np.rad2deg(rotation.to_phi_omega_kappa(matrix))
        table.to_csv(project / "exposures.csv", index=False)
    order = f'inputs.exposures.angles.order="{declared}"'
    return carry_out(adjustment_alone, RunRequest(project / "project.toml", out, (order,)))


@pytest.mark.parametrize("declared", ["omega-phi-kappa", "phi-omega-kappa"])
def test_the_other_order_of_omega_and_phi(tmp_path: Path, declared: str) -> None:
    """With tilts of 3° the orders differ by 0.2° in κ, mostly: rays hardly miss, attitudes do not fit."""
    outcome = in_other_order(tmp_path / "project", declared, 3.0, tmp_path / "out")
    (said,) = (text for text in outcome.summary.problems if "ω and φ in the other order" in text)
    assert "Check angles.order of the exposures" in said
    size, sigma = re.findall(r"([+−][\d.]+) ± ([\d.]+) %", said)[0]
    expected = 100.0 if declared == "omega-phi-kappa" else -100.0
    assert float(size.replace("−", "-")) == pytest.approx(expected, abs=4.0 * float(sigma))
    # Nothing but the order explains it.
    assert not any("does not fit: computed − given" in text for text in outcome.summary.problems)


@pytest.mark.parametrize(
    ("declared", "meant"),
    [("omega-phi-kappa", "phi-omega-kappa"), ("phi-omega-kappa", "omega-phi-kappa")],
)
def test_the_other_order_with_large_tilts(tmp_path: Path, declared: str, meant: str) -> None:
    """Images with large tilts miss their neighbours, in some blocks two of them and in others most."""
    outcome = in_other_order(tmp_path / "project", declared, 5.0, tmp_path / "out")
    assert outcome.summary.status == "input_error"
    assert "The angles look like the other order of ω and φ" in str(outcome.error)
    assert f'Declare angles.order = "{meant}" instead of "{declared}".' in str(outcome.error)


@pytest.mark.parametrize(
    ("block", "turn"),
    [
        pytest.param(angles, turn, marks=() if (angles, turn) in TURNED_DAILY else pytest.mark.slow)
        for angles in CONVENTIONS
        for turn in (90, 180, 270)
    ],
    indirect=["block"],
)
def test_images_turned_against_their_angles(block: Path, named, turn: int) -> None:
    def turned(table: pd.DataFrame) -> pd.DataFrame:
        column = "heading" if "heading" in table else "kappa"
        return table.assign(**{column: (table[column] + turn) % 360.0})

    said = named(block, turned)
    # Turned back they fit; headings count clockwise, κ does not.
    back = 360 - turn
    assert f"rotated by {back}°" in said
    assert "Check" in said


def test_a_mounting_turned_by_half_a_turn(block: Path, tmp_path: Path) -> None:
    """With headings the rays contradict it, with ω, φ, κ only the track of the aircraft does."""
    said = examined(block, tmp_path / "out", "cameras.UCE-80.mount_deg=180")
    if "The direction of flight is 180° off" not in said:
        assert "The images look rotated by 180°" in said
    assert "mount_deg" in said


@pytest.mark.parametrize("share", [pytest.param(1, marks=pytest.mark.slow), 2])
@pytest.mark.parametrize("block", BY_OPK_DAILY, indirect=True)
def test_one_of_two_cameras_turned(block: Path, named, share: int) -> None:
    """The strips of a second camera, every image turned by 180°, are named as that camera's."""
    project = (block / "project.toml").read_text(encoding="utf-8")
    start = project.index("[cameras.UCE-80]")
    camera = project[start : project.index("[inputs.image_points]")]

    def with_a_second_camera(table: pd.DataFrame) -> pd.DataFrame:
        column = "heading" if "heading" in table else "kappa"
        others = table["strip"].isin(sorted(table["strip"].unique())[-share:])
        turned = np.where(others, (table[column] + 180.0) % 360.0, table[column])
        return table.assign(camera=np.where(others, "SECOND", table["camera"]), **{column: turned})

    text = project.replace(camera, camera + camera.replace("UCE-80", "SECOND"))
    (block / "two.toml").write_text(text, encoding="utf-8")
    try:
        shutil.copy(block / "project.toml", block / "one.toml")
        shutil.move(block / "two.toml", block / "project.toml")
        said = named(block, with_a_second_camera)
    finally:
        shutil.move(block / "one.toml", block / "project.toml")
    assert "camera SECOND" in said
    assert "180°" in said


@pytest.mark.parametrize("angles", [HEADINGS, pytest.param(OMEGA_PHI_KAPPA, marks=pytest.mark.slow)])
def test_an_ordinary_misalignment_is_where_the_adjustment_begins(tmp_path: Path, angles: str) -> None:
    """Two degrees, as of a camera that was never calibrated; only where the boresight is estimated."""
    true = (1.5, -2.0, 1.0)
    project = simulated(tmp_path / "block", "uce-high", angles, f"truth.boresight_deg={list(true)}")
    held, free = ('adjustment.free=["gnss_shift"]', 'adjustment.free=["boresight", "gnss_shift"]')
    outcome = carry_out(adjustment_alone, RunRequest(project / "project.toml", tmp_path / "free", (free,)))
    assert outcome.error is None, outcome.error
    said = next(text for text in outcome.summary.problems if "misalignment of camera and INS" in text)
    about = [float(value) for value in re.findall(r"(?:roll|pitch|yaw) ([+-][\d.]+)°", said)]
    assert about == pytest.approx(true, abs=0.1)
    found = {item.parameter: item for item in outcome.summary.parameters or ()}
    for name, value in zip(("roll", "pitch", "yaw"), true, strict=True):
        item = found[f"boresight_{name}"]
        assert item.value is not None
        assert item.sigma is not None
        assert abs(item.value - value) < 4.0 * item.sigma
    outcome = carry_out(adjustment_alone, RunRequest(project / "project.toml", tmp_path / "held", (held,)))
    assert outcome.summary.status == "input_error"
    assert "free the boresight" in str(outcome.error)


HIGH = (
    "points.count=300", *(f"flight.{k}.height_m=6250" for k in (0, 1)), "flight.1.spacing_m=14000",
    "flight.0.directions=single", "flight.1.directions=single",
)  # fmt: skip


def rolled(folder: Path) -> Path:
    """The project file of one strip at 6,000 m, with a camera 0.67° off, which control points alone show."""
    high = load_simulation("dmc-20cm", (*HIGH, "truth.boresight_deg=[0.67, 0.0, 0.0]"), 1)
    project = simulate_project(high, folder).project_file
    exposures = pd.read_csv(folder / "exposures.csv", dtype=str)
    exposures = exposures[exposures["strip"] == "E02"]
    exposures.to_csv(folder / "exposures.csv", index=False)
    points = pd.read_csv(folder / "image_points.csv", dtype=str)
    points[points["image"].isin(exposures["image"])].to_csv(folder / "image_points.csv", index=False)
    return project


FREE_BORESIGHT = 'adjustment.free=["boresight"]'


def test_the_doctor_names_control_points_mixed_up_behind_a_roll_that_only_they_show(tmp_path: Path) -> None:
    """The roll moves points by 77 m, and heights by 4 m along the swath: more than names mixed up allow."""
    project = rolled(tmp_path)
    measured = set(pd.read_csv(tmp_path / "image_points.csv", dtype=str)["point"])
    control = pd.read_csv(tmp_path / "control.csv", dtype=str)
    one, other = [i for i in control.index if control.loc[i, "point"] in measured][2:11:8]
    names = control.loc[[one, other], "point"].tolist()
    control.loc[[one, other], "point"] = names[::-1]
    control.to_csv(tmp_path / "control.csv", index=False)
    assert f"look mixed up: by its rays {names[0]} lies at {names[1]}" in examined(
        project.parent, tmp_path / "out", FREE_BORESIGHT
    )


def test_a_roll_that_only_control_points_show_is_no_wrong_control(tmp_path: Path) -> None:
    """All 60 surveyed points were called wrong, by 86 m."""
    project = rolled(tmp_path)
    outcome = carry_out(adjustment_alone, RunRequest(project, tmp_path / "results", (FREE_BORESIGHT,)))
    assert outcome.error is None, outcome.error
    (said,) = (text for text in outcome.summary.problems if "misalignment of camera and INS" in text)
    assert said.startswith(
        "The control points show a misalignment of camera and INS: camera DMC-120 roll +0.6"
    )
    assert re.search(r"otherwise the coordinates are [78]\d m off", said)
    (roll,) = (item for item in outcome.summary.parameters or () if item.parameter == "boresight_roll")
    assert roll.value is not None
    assert roll.sigma is not None
    assert abs(roll.value - 0.67) < 4.0 * roll.sigma < 0.05


@pytest.mark.parametrize(("role", "refused"), [("check", False), ("control", True)])
def test_a_wrong_image_point_of_a_check_point_is_no_reason_to_refuse(
    tmp_path: Path, role: str, refused: bool
) -> None:
    """A point in two images, 4 mm off along the flight in one of them: a height hundreds of metres off."""
    project = simulate_project(load_simulation("dmc-20cm", ("points.count=300",), 1), tmp_path).project_file
    control = pd.read_csv(tmp_path / "control.csv", dtype=str)
    points = pd.read_csv(tmp_path / "image_points.csv", dtype={"image": str, "point": str})
    own = points[points["point"].isin(control.loc[control["role"] == role, "point"])]
    name = own["point"].iloc[0]
    seen = own[own["point"] == name]
    points = points.drop(seen.index[2:])
    points.loc[seen.index[1], "x"] += 4.0
    points.to_csv(tmp_path / "image_points.csv", index=False)
    outcome = carry_out(adjustment_alone, RunRequest(project, tmp_path / "results"))
    assert (outcome.summary.status == "input_error") == refused
    said = str(outcome.error) if refused else "\n".join(outcome.summary.problems)
    assert name in said
    assert "50 m" in said


def test_control_points_in_the_wrong_place_are_no_misalignment(tmp_path: Path) -> None:
    """80 m to the north of where strips of several directions intersect."""
    simulation = load_simulation("dmc-20cm", (*HIGH, "truth.boresight_deg=[0.0, 0.0, 0.0]"), 1)
    project = simulate_project(simulation, tmp_path).project_file
    table = pd.read_csv(tmp_path / "control.csv", dtype={"point": str})
    table.assign(y=table["y"] + 80.0).to_csv(tmp_path / "control.csv", index=False)
    free = 'adjustment.free=["boresight", "gnss_shift"]'
    outcome = carry_out(adjustment_alone, RunRequest(project, tmp_path / "results", (free,)))
    assert outcome.summary.status == "input_error"
    assert "look like those of different datums" in str(outcome.error)


@pytest.fixture(scope="module")
def with_lever_arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The antenna 0.35 m before, 0.12 m to the left of and 1.20 m above the camera."""
    folder = tmp_path_factory.mktemp("lever_arm")
    return simulated(folder, "uce-high", f"truth.lever_arm_m={list(LEVER_ARM)}")


def adjusted(project: Path, out: Path, signs: tuple[int, ...], free: str, rejection: str = '"none"') -> str:
    arm = [sign * value for sign, value in zip(signs, LEVER_ARM, strict=True)]
    overrides = (
        f"cameras.UCE-80.lever_arm_m={arm}",
        f"adjustment.free=[{free}]",
        f"adjustment.rejection={rejection}",
    )
    outcome = carry_out(adjustment_alone, RunRequest(project / "project.toml", out, overrides))
    return "\n".join(text for text in outcome.summary.problems if "given lever arm" in text)


SHIFT_FREE, ALL_HELD, ARM_FREE = '"boresight", "gnss_shift"', '"boresight"', '"boresight", "lever_arm"'


@pytest.mark.parametrize(
    ("signs", "free", "rejection", "words"),
    [
        pytest.param((-1, -1, -1), SHIFT_FREE, '"none"', "in all three components", marks=pytest.mark.slow),
        pytest.param((-1, -1, -1), ALL_HELD, '"none"', "in all three components", marks=pytest.mark.slow),
        ((-1, -1, -1), ALL_HELD, "{ critical_value = 4.13 }", "in all three components"),
        ((-1, -1, -1), ARM_FREE, '"none"', "in all three components"),
        ((-1, 1, 1), SHIFT_FREE, "{ critical_value = 4.13 }", "along forward"),
        pytest.param((1, -1, 1), SHIFT_FREE, '"none"', "along right", marks=pytest.mark.slow),
        pytest.param((1, 1, -1), ALL_HELD, '"none"', "along down", marks=pytest.mark.slow),
    ],
)
def test_wrong_signs_of_a_lever_arm(
    with_lever_arm: Path, tmp_path: Path, signs: tuple[int, ...], free: str, rejection: str, words: str
) -> None:
    """Held or free, with the shift held or free, with and without rejection of what contradicts it."""
    said = adjusted(with_lever_arm, tmp_path, signs, free, rejection)
    assert f"had the wrong sign {words}: (" in said
    assert "correct lever_arm_m" in said


@pytest.mark.parametrize(
    "free", [*(pytest.param(free, marks=pytest.mark.slow) for free in (SHIFT_FREE, ALL_HELD)), ARM_FREE]
)
def test_a_right_lever_arm_is_not_doubted(with_lever_arm: Path, tmp_path: Path, free: str) -> None:
    assert adjusted(with_lever_arm, tmp_path, (1, 1, 1), free) == ""


def test_a_wrong_sign_in_height_is_named_with_the_shift_it_may_be_instead(
    with_lever_arm: Path, tmp_path: Path
) -> None:
    """A free shift takes the whole of −2 l in height: either the sign is wrong or GNSS is 2.7 m off."""
    said = adjusted(with_lever_arm, tmp_path, (1, 1, -1), SHIFT_FREE)
    assert "had the wrong sign along down: (" in said
    found = re.search(r"Otherwise the GNSS has the estimated shift: \((.*), (.*), (.*)\) m\.", said)
    assert found is not None
    # 2 · 1.20 m and the true shift of 0.286 m.
    assert float(found[3]) == pytest.approx(2.69, abs=0.1)


@pytest.mark.parametrize("shift", [1.5, pytest.param(-1.5, marks=pytest.mark.slow)])
def test_a_real_shift_is_not_taken_for_a_sign(tmp_path: Path, shift: float) -> None:
    """1.5 m in height, either way, with a right lever arm of 1.2 m in height."""
    changes = (f"truth.lever_arm_m={list(LEVER_ARM)}", f"truth.gnss_shift_m=[0.0, 0.0, {shift}]")
    project = simulated(tmp_path / "project", "uce-high", *changes)
    assert adjusted(project, tmp_path / "out", (1, 1, 1), SHIFT_FREE) == ""


# Daily one preset of each kind of aircraft and height; the simulation of each is a test of its own.
@pytest.mark.parametrize(
    "preset",
    [
        pytest.param(name, marks=() if name in ("uce-low", "dmc-burn-in", "rmk-8cm") else pytest.mark.slow)
        for name in PRESETS
    ],
)
def test_good_projects_raise_no_suspicion(tmp_path: Path, preset: str) -> None:
    """Ten presets, each with the angles, the seed and the lever arm of its own."""
    number = list(PRESETS).index(preset)
    changes = (
        OMEGA_PHI_KAPPA if number % 2 else HEADINGS,
        f"seed={100 + number}",
        "truth.lever_arm_m=[0.35, -0.12, -1.2]",
    )
    project = simulated(tmp_path / "project", preset, *changes)
    said = [
        text
        for text in examined(project, tmp_path / "out").splitlines()
        # How many points are weak is a count and no suspicion.
        if not text.endswith(("…).", ").")) or "are not used" not in text
    ]
    assert said == []


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS)
def test_good_projects_raise_no_suspicion_when_adjusted(tmp_path: Path, preset: str) -> None:
    """The lever arm that was simulated is given; what differs from what is given is free."""
    as_given = ("truth.focal_length_change_mm=0.0", "truth.principal_point_change_mm=[0.0, 0.0]")
    arm, no_shift = "truth.lever_arm_m=[0.35, -0.12, -1.2]", "truth.gnss_shift_m=[0.0, 0.0, 0.0]"
    for number, free in enumerate((SHIFT_FREE, ALL_HELD, ARM_FREE)):
        # Check points show a camera that differs from the given one, and a shift that is held at zero.
        changes = (arm, *as_given) if free == SHIFT_FREE else (arm, *as_given, no_shift)
        project = simulated(tmp_path / f"project{number}", preset, *changes)
        camera = next(iter(load_project(project / "project.toml", ()).cameras))
        overrides = (f"cameras.{camera}.lever_arm_m=[0.35, -0.12, -1.2]", f"adjustment.free=[{free}]")
        outcome = carry_out(
            adjustment_alone, RunRequest(project / "project.toml", tmp_path / "out", overrides)
        )
        assert outcome.error is None, outcome.error
        doubts = [
            text for text in outcome.summary.problems if "looks as if" in text or "height system" in text
        ]
        assert doubts == []


@pytest.mark.parametrize(
    "sigma_m", [*(pytest.param(sigma, marks=pytest.mark.slow) for sigma in (0.05, 5.0)), 10.0]
)
def test_another_height_system_is_named_whatever_the_sigma_of_positions(
    tmp_path: Path, sigma_m: float
) -> None:
    """48 m common to all points: by the plausibility check, the tests of the model, and what is rejected."""
    simulate_project(load_simulation("uce-high", ("points.count=400",)), tmp_path)
    table = pd.read_csv(tmp_path / "control.csv", dtype={"point": str})
    table.assign(z=table["z"] - 48.0).to_csv(tmp_path / "control.csv", index=False)
    changes = (
        f"inputs.exposures.sigma.position_m={sigma_m}",
        'adjustment.free=["boresight"]',
        'adjustment.rejection={critical_value=4.0, test="observations"}',
    )
    outcome = carry_out(adjustment_alone, RunRequest(tmp_path / "project.toml", tmp_path / "out", changes))
    assert outcome.error is None
    said = outcome.summary.problems
    assert "different height systems" in said[0]
    assert any(re.search(r"GNSS positions.* are 48[.\d]* ± .* m too high", text) for text in said)
    assert any("28 of 28 GNSS positions were rejected" in text for text in said)


def test_drifts_of_strips_are_said_where_none_of_them_is_significant_by_itself(tmp_path: Path) -> None:
    """Eight strips with 2.5 mm/s; σ0 is 0.99, and positions in plan and tilts are off by 1.2 σ (RMS)."""
    changes = (
        "points.count=300", "project.free=[]", "flight.0.directions=both", "flight.1.directions=both",
        "truth.focal_length_change_mm=0.0", "truth.principal_point_change_mm=[0.0, 0.0]",
        *(f"truth.{name}=[0.0, 0.0, 0.0]" for name in ("boresight_deg", "gnss_shift_m", "strip_bias_m")),
        "truth.strip_drift_m_s=[0.0025, 0.0025, 0.0025]",
    )  # fmt: skip
    simulate_project(load_simulation("uce-high", changes, 3), tmp_path)
    outcome = carry_out(adjustment_alone, RunRequest(tmp_path / "project.toml"))
    assert outcome.error is None, outcome.error
    assert not outcome.summary.model_findings
    (said,) = (item for item in outcome.summary.problems if "varies between strips" in item)
    assert said.startswith("The GNSS drift y varies between strips by 0.0028 m/s (RMS), more than expected")
    assert said.endswith("Free gnss_drift (adjustment.free), or give its prior a larger σ.")


def test_attitudes_worse_than_stated_are_refused_with_the_sigma_and_its_key(tmp_path: Path) -> None:
    simulate_project(load_simulation("uce-high", ("points.count=300",)), tmp_path)
    table = pd.read_csv(tmp_path / "exposures.csv")
    noise = np.random.default_rng(4).normal(0.0, 0.5, (len(table), 3))
    table[["heading", "pitch", "roll"]] += noise
    table["heading"] %= 360.0
    table.to_csv(tmp_path / "exposures.csv", index=False)
    outcome = carry_out(adjustment_alone, RunRequest(tmp_path / "project.toml", tmp_path / "out"))
    assert outcome.summary.status == "input_error"
    said = str(outcome.error)
    assert "the stated σ of 0.05 m and 0.008° explain" in said
    assert "inputs.exposures.sigma" in said
    assert "checks.tie_residual_px" in said
    assert "state their σ" in said
