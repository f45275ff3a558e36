"""The doctor's list: mistakes of simulated deliveries, one and two at once, are named with their remedy."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from _pytest.mark import ParameterSet

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.examination import ListedMistake, examine_everything
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tasks.store.store import Store
from tests.flows.adjustment_alone import adjustment_alone

FOOT = 0.3048
# Twenty images in four lines, two of them crossing; tilted enough that orders of angles differ.
SMALL = (
    "flight.0.lines=2",
    "flight.0.exposures=6",
    "flight.1.lines=2",
    "flight.1.exposures=4",
    "points.count=300",
    "trajectory.attitude_deg=[2.0, 2.0, 2.0]",
)
OMEGA, HEADING = "project.angles=omega-phi-kappa", "project.angles=heading-pitch-roll"
UTM = ("project.crs=EPSG:25832", "project.latitude_deg=48.9", "project.longitude_deg=9.6")


@dataclass
class Delivery:
    """The files of a delivery while mistakes are made in them; project: what replaces text of the file."""

    exposures: pd.DataFrame
    points: pd.DataFrame
    control: pd.DataFrame
    project: str


Wrong = Callable[[Delivery], None]


def simulated(folder: Path, *changes: str, preset: str = "uce-high") -> Path:
    simulate_project(load_simulation(preset, changes), folder)
    return folder


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    root = tmp_path_factory.mktemp("blocks")
    arm = "truth.lever_arm_m=[1.5, -0.9, -1.2]"
    given = {
        "omega": (OMEGA,),
        # The order of small angles has no effect, and then it is no mistake.
        "tilted": (OMEGA, "trajectory.attitude_deg=[8.0, 8.0, 2.0]"),
        "heading": (HEADING,),
        "heading utm": (HEADING, *UTM),
        "utm": (OMEGA, *UTM),
        "arm": (HEADING, arm, "project.free=[]", "truth.boresight_deg=[0,0,0]"),
        "time": (HEADING, "truth.time_offset_s=0.05", "project.free=[]", "truth.boresight_deg=[0,0,0]"),
    }
    return {name: simulated(root / name, *SMALL, *changes) for name, changes in given.items()}


def listed(block: Path, folder: Path, *wrong: Wrong) -> list[ListedMistake]:
    """The doctor's list for a block with mistakes made in it."""
    shutil.copytree(block, folder)
    text = {"point": str, "image": str, "strip": str, "flight": str}
    tables = [pd.read_csv(folder / f"{n}.csv", dtype=text) for n in ("exposures", "image_points", "control")]
    delivery = Delivery(*tables, (folder / "project.toml").read_text(encoding="utf-8"))
    for mistake in wrong:
        mistake(delivery)
    delivery.exposures.to_csv(folder / "exposures.csv", index=False)
    delivery.points.to_csv(folder / "image_points.csv", index=False)
    delivery.control.to_csv(folder / "control.csv", index=False)
    (folder / "project.toml").write_text(delivery.project, encoding="utf-8")
    store = Store.of(folder / "out")
    store.begin_run()
    return examine_everything(load_project(folder / "project.toml", ()), store).mistakes


def replaced(old: str, new: str, part: str = "") -> Wrong:
    """Another declaration, in a part of the project file that begins with a text."""

    def wrong(delivery: Delivery) -> None:
        begin = delivery.project.index(part)
        head, tail = delivery.project[:begin], delivery.project[begin:]
        assert old in tail
        delivery.project = head + tail.replace(old, new, 1)

    return wrong


def angles(change: Callable[[np.ndarray], np.ndarray]) -> Wrong:
    def wrong(delivery: Delivery) -> None:
        table = delivery.exposures
        names = [name for name in ("omega", "phi", "kappa", "heading", "pitch", "roll") if name in table]
        table[names] = change(table[names].to_numpy())

    return wrong


def scaled(table: str, columns: str, factor: float) -> Wrong:
    def wrong(delivery: Delivery) -> None:
        own = getattr(delivery, table)
        own[list(columns)] = own[list(columns)] * factor

    return wrong


def swapped(table: str) -> Wrong:
    def wrong(delivery: Delivery) -> None:
        own = getattr(delivery, table)
        own[["x", "y"]] = own[["y", "x"]].to_numpy()

    return wrong


def second_head(delivery: Delivery) -> None:
    """Not a mistake: every exposure again by another head, 20 µs later."""
    own, points = delivery.exposures, delivery.points
    again = own.assign(image="B" + own["image"], time=own["time"] + 2e-5)
    delivery.exposures = pd.concat([own, again])
    noise = np.random.default_rng(3).normal(0.0, 5e-4, (len(points), 2))
    measured = points.assign(image="B" + points["image"])
    measured[["x", "y"]] += noise
    delivery.points = pd.concat([points, measured])


def y_down(delivery: Delivery) -> None:
    delivery.points["y"] = -delivery.points["y"]


def x_left(delivery: Delivery) -> None:
    delivery.points["x"] *= -1.0


def transposed(values: np.ndarray) -> np.ndarray:
    from adjust.geometry.rotation import from_omega_phi_kappa, to_omega_phi_kappa

    turned = np.swapaxes(from_omega_phi_kappa(np.deg2rad(values)), 1, 2)
    return np.rad2deg(to_omega_phi_kappa(turned))


def other_order(values: np.ndarray) -> np.ndarray:
    from adjust.geometry.rotation import from_omega_phi_kappa, to_phi_omega_kappa

    return np.rad2deg(to_phi_omega_kappa(from_omega_phi_kappa(np.deg2rad(values))))


def last_by(degrees: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda values: np.column_stack([values[:, :2], (values[:, 2] + degrees) % 360.0])


def heading_by(degrees: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda values: np.column_stack([(values[:, 0] + degrees) % 360.0, values[:, 1:]])


def noisy(values: np.ndarray) -> np.ndarray:
    """Errors of 0.05°, twelve times those that are stated."""
    return values + np.random.default_rng(7).normal(0.0, 0.05, values.shape)


def heights(table: str, metres: float) -> Wrong:
    def wrong(delivery: Delivery) -> None:
        getattr(delivery, table)["z"] += metres

    return wrong


def in_zone(table: str, crs: str) -> Wrong:
    """Coordinates of the true zone, declared to be of another; the declaration changes, the file does not."""
    part = "[inputs.control]" if table == "control" else "[inputs.exposures]"
    return replaced('crs = "EPSG:25832"', f'crs = "{crs}"', part)


def mixed_control(delivery: Delivery) -> None:
    points = delivery.control["point"].to_numpy(copy=True)
    points[[10, 40]] = points[[40, 10]]
    delivery.control["point"] = points


def mixed_images(delivery: Delivery) -> None:
    names = delivery.exposures["image"].to_numpy(copy=True)
    names[[2, 9]] = names[[9, 2]]
    delivery.exposures["image"] = names


def renumbered(order: Callable[[np.ndarray], np.ndarray]) -> Wrong:
    """The images of one strip are numbered otherwise in the exposures."""

    def wrong(delivery: Delivery) -> None:
        rows = np.flatnonzero(delivery.exposures["strip"] == "E01")
        names = delivery.exposures["image"].to_numpy(copy=True)
        names[rows] = order(names[rows])
        delivery.exposures["image"] = names

    return wrong


def zeros_lost(delivery: Delivery) -> None:
    """A spreadsheet has made numbers of the names in one of the files."""
    names = delivery.control["point"].str.removeprefix("C")
    of_points = dict(zip(delivery.control["point"], names.str.lstrip("0"), strict=True))
    delivery.control["point"] = names
    delivery.points["point"] = delivery.points["point"].replace(of_points)


def single_rays(delivery: Delivery) -> None:
    """Half of the points of one image are called otherwise."""
    first = delivery.points["image"] == delivery.points["image"].iloc[0]
    first &= np.arange(len(first)) % 2 == 0
    delivery.points.loc[first, "point"] = "X" + delivery.points.loc[first, "point"]


def without_points(delivery: Delivery) -> None:
    gone = delivery.points["image"].isin(sorted(delivery.points["image"].unique())[:2])
    delivery.points = delivery.points[~gone]


GON = angles(lambda values: values / 0.9)
RADIANS = angles(np.deg2rad)
#: Block, mistakes, and for each of them a part of its line or, if it has none, of its words and remedy.
WRONG: Mapping[str, tuple[str, tuple[Wrong, ...], tuple[str, ...]]] = {
    "micrometres": ("omega", (scaled("points", "xy", 1e3),), ('image_points.unit = "um"',)),
    "millimetres declared pixels": ("omega", (replaced('unit = "mm"', 'unit = "px"'),), ('unit = "mm"',)),
    "gon": ("omega", (GON,), ('angles.unit = "gon"',)),
    "gon headings": ("heading", (GON,), ('angles.unit = "gon"',)),
    "radians": ("omega", (RADIANS,), ('angles.unit = "rad"',)),
    "degrees declared gon": ("omega", (replaced('unit = "deg"', 'unit = "gon"'),), ('angles.unit = "deg"',)),
    "phi-omega-kappa": ("tilted", (angles(other_order),), ('angles.order = "phi-omega-kappa"',)),
    "omega-phi-kappa declared phi": (
        "tilted",
        (replaced('"omega-phi-kappa"', '"phi-omega-kappa"'),),
        ('angles.order = "omega-phi-kappa"',),
    ),
    "transposed": ("omega", (angles(transposed),), ("Export the angles of the rotation from the camera",)),
    "kappa turned": ("omega", (angles(last_by(90.0)),), ("rotated by 270°",)),
    "kappa clockwise": (
        "omega",
        (angles(lambda values: values * np.array([1.0, 1.0, -1.0])),),
        ("κ appears to be counted clockwise",),
    ),
    "kappa clockwise in a map": (
        "utm",
        (angles(lambda values: values * np.array([1.0, 1.0, -1.0])),),
        ("κ appears to be counted clockwise",),
    ),
    "headings turned": ("heading", (angles(heading_by(180.0)),), ("rotated by 180°",)),
    "y down": ("omega", (y_down,), ("change the sign of y",)),
    "x to the left": ("omega", (x_left,), ("change the sign of x",)),
    "columns of image points": ("omega", (swapped("points"),), ('image_points.columns = { x = "y"',)),
    "exposures swapped": ("omega", (swapped("exposures"),), ('exposures.columns = { x = "y"',)),
    "control swapped": ("omega", (swapped("control"),), ('control.columns = { x = "y"',)),
    "exposures swapped in a map": ("utm", (swapped("exposures"),), ('exposures.columns = { x = "y"',)),
    "exposures in feet": (
        "omega",
        (scaled("exposures", "xyz", 1 / FOOT),),
        ('exposures.length_unit = "ft"',),
    ),
    "heights of control in feet": (
        "omega",
        (scaled("control", "z", 1 / FOOT),),
        ('control.height_unit = "ft"',),
    ),
    "map coordinates in feet": (
        "utm",
        (scaled("exposures", "xy", 1 / FOOT),),
        ('length_unit = "ft"', 'height_unit = "m"'),
    ),
    "undulation": ("utm", (heights("exposures", -48.0),), ("heights = { geoid",)),
    "zone of the control": ("utm", (in_zone("control", "EPSG:25833"),), ('control.crs = "EPSG:25832"',)),
    "zone of the exposures": (
        "utm",
        (in_zone("exposures", "EPSG:25831"),),
        ('exposures.crs = "EPSG:25832"',),
    ),
    "antenna": (
        "arm",
        (
            replaced('position = "antenna"', 'position = "projection_centre"'),
            replaced("mount_deg", "lever_arm_m = [1.5, -0.9, -1.2]\nmount_deg"),
        ),
        ('position = "antenna"',),
    ),
    "time offset": ("time", (), ('adjustment.free = [..., "time_offset"]',)),
    "time offset of two heads": ("time", (second_head,), ("look 49 ms late",)),
    "control mixed up": ("omega", (mixed_control,), ("Correct the names in the file of the control",)),
    "headings of the map": (
        "heading utm",
        (replaced('"true-north"', '"grid"'),),
        ('angles.reference = "true-north"',),
    ),
    # The meridian convergence at 9.6° east in zone 32.
    "headings from the map": ("heading utm", (angles(heading_by(-0.452)),), ('angles.reference = "grid"',)),
    "attitudes of another grade": ("heading", (angles(noisy),), ("If GNSS and INS are not as accurate",)),
    "zeros lost": ("omega", (zeros_lost,), ("'001' may be '1'",)),
    "images mixed up": ("omega", (mixed_images,), ("Exchange the names",)),
    "strip shifted": (
        "omega",
        (renumbered(lambda names: np.roll(names, 1)),),
        ("strip E01 look shifted by one image",),
    ),
    "strip the other way": (
        "heading",
        (renumbered(lambda names: names[::-1]),),
        ("strip E01 look numbered in the opposite order",),
    ),
    "single rays": ("omega", (single_rays,), ("measured in one image only",)),
    "images without points": ("omega", (without_points,), ("have no image points",)),
    "micrometres and gon": (
        "omega",
        (scaled("points", "xy", 1e3), GON),
        ('image_points.unit = "um"', 'angles.unit = "gon"'),
    ),
    "gon and undulation": (
        "utm",
        (GON, heights("exposures", -48.0)),
        ('angles.unit = "gon"', "heights = { geoid"),
    ),
    "y down and radians": ("omega", (y_down, RADIANS), ("change the sign of y", 'angles.unit = "rad"')),
    "order and feet": (
        "tilted",
        (angles(other_order), scaled("exposures", "xyz", 1 / FOOT)),
        ('angles.order = "phi-omega-kappa"', 'exposures.length_unit = "ft"'),
    ),
    "control swapped and images mixed up": (
        "omega",
        (swapped("control"), mixed_images),
        ('control.columns = { x = "y"', "Exchange the names"),
    ),
    "gon and control mixed up": (
        "omega",
        (GON, mixed_control),
        ('angles.unit = "gon"', "Correct the names in the file of the control"),
    ),
}


#: One of each kind, by default, without those that are mended by default; all of them are a slow test.
QUICK = (
    "phi-omega-kappa", "kappa clockwise", "columns of image points", "x to the left",
    "exposures swapped in a map", "exposures in feet", "antenna", "time offset of two heads",
    "control mixed up", "images mixed up", "gon and undulation", "y down and radians", "zeros lost",
    "headings from the map", "attitudes of another grade", "strip shifted",
)  # fmt: skip


def some_by_default(names: Iterable[str], quick: Sequence[str]) -> list[ParameterSet]:
    return [pytest.param(name, marks=[] if name in quick else [pytest.mark.slow]) for name in names]


@pytest.mark.parametrize("name", some_by_default(WRONG, QUICK))
def test_every_mistake_is_named_with_its_remedy(
    blocks: Mapping[str, Path], tmp_path: Path, name: str
) -> None:
    named(name, blocks, tmp_path / "delivery")


def named(name: str, blocks: Mapping[str, Path], folder: Path) -> list[ListedMistake]:
    """The doctor's list of mistakes in which each of them is named once."""
    block, wrong, expected = WRONG[name]
    found = listed(blocks[block], folder, *wrong)
    said = [f"{one.what} {one.remedy} {one.declare}" for one in found]
    assert len(said) == len(expected), said
    for words in expected:
        assert sum(words in one for one in said) == 1, said
    return found


@pytest.mark.parametrize(
    ("lines", "wrong", "says"),
    [
        (2, renumbered(lambda names: np.roll(names, 1)), "strip E01 look shifted by one image"),
        (5, renumbered(lambda names: names[::-1]), "strip E01 look numbered in the opposite order"),
        (5, mixed_images, "look mixed up"),
    ],
)
def test_a_run_names_what_the_doctor_names(tmp_path: Path, lines: int, wrong: Wrong, says: str) -> None:
    """Two lines: the strip spoils the median of all rays; five: its images stand out."""
    block = simulated(tmp_path / "block", *SMALL, f"flight.0.lines={lines}", OMEGA)
    (listed_by_doctor,) = listed(block, tmp_path / "delivery", wrong)
    outcome = carry_out(adjustment_alone, RunRequest(tmp_path / "delivery" / "project.toml"))
    assert says in listed_by_doctor.what
    assert says in str(outcome.error)
    assert listed_by_doctor.remedy in str(outcome.error)
    assert "None of the common mistakes" not in str(outcome.error)


def test_images_without_attitude_do_not_hide_a_mistake_in_the_others(
    blocks: Mapping[str, Path], tmp_path: Path
) -> None:
    """Their orientations come from those of the others, and fit them: 8° of tilt, and nothing was named."""
    project = shutil.copytree(blocks["tilted"], tmp_path / "block")
    table = pd.read_csv(project / "exposures.csv", dtype=str)
    names = ["omega", "phi", "kappa"]
    table[names] = other_order(table[names].to_numpy(float))
    table.loc[::3, names] = np.nan
    table.to_csv(project / "exposures.csv", index=False)
    found = carry_out(adjustment_alone, RunRequest(project / "project.toml", tmp_path / "out"))
    assert found.error is None, found.error
    problems = json.loads((found.directory / "summary.json").read_text())["problems"]
    (said,) = (text for text in problems if text.startswith("The rays of tie points miss each other"))
    assert "The angles look like the other order of ω and φ" in said


MENDED = (
    "micrometres and gon",
    "omega-phi-kappa declared phi",
    "columns of image points",
    "exposures in feet",
    "heights of control in feet",
    "map coordinates in feet",
    "zone of the exposures",
    "antenna",
)


@pytest.mark.parametrize("name", some_by_default(MENDED, ("micrometres and gon", "zone of the exposures")))
def test_the_lines_of_the_list_mend_the_delivery(
    blocks: Mapping[str, Path], tmp_path: Path, name: str
) -> None:
    """Put into the project file they leave nothing to be found."""
    lines = [one.declare for one in named(name, blocks, tmp_path / "delivery")]
    store = Store.of(tmp_path / "mended")
    store.begin_run()
    found = examine_everything(load_project(tmp_path / "delivery" / "project.toml", lines), store)
    assert found.refusal is None
    assert found.mistakes == []


CLEAN: Mapping[str, tuple[str, ...]] = {
    "uce-high": ("points.count=300", OMEGA),
    "uce-high south": ("points.count=300", OMEGA, "seed=5",
                       "project.crs=EPSG:32719", "project.latitude_deg=-33.4", "project.longitude_deg=-70.6"),
    "uce-low": ("flight.0.lines=2", "flight.0.exposures=6", "flight.1.lines=1", "flight.1.exposures=6",
                "points.count=300", HEADING),
    "uce-calibration": ("points.count=600", OMEGA, *UTM),
    "dmc-burn-in": ("points.count=300", HEADING, *UTM),
    "dmc-20cm": ("flight.0.lines=3", "flight.0.exposures=8", "points.count=300", OMEGA),
    "dmc2-140": ("flight.0.lines=3", "flight.0.exposures=8", "points.count=300", OMEGA,
                 "project.crs=EPSG:2154", "project.latitude_deg=45.2", "project.longitude_deg=4.1"),
    "dmc2-250": ("flight.0.lines=3", "flight.0.exposures=8", "points.count=300", HEADING),
    "ucx-20cm": ("flight.0.lines=3", "flight.0.exposures=8", "points.count=300", HEADING, *UTM),
    "rmk-8cm": ("flight.0.lines=3", "flight.0.exposures=8", "points.count=300", OMEGA, "seed=11"),
}  # fmt: skip


@pytest.mark.parametrize("preset", some_by_default(CLEAN, ("uce-high south",)))
def test_a_clean_delivery_has_no_mistake(tmp_path: Path, preset: str) -> None:
    """Ten presets in both kinds of angles, in local frames and four map projections, with angles in gon."""
    block = simulated(tmp_path / "block", *CLEAN[preset], preset=preset.split()[0])
    number = list(CLEAN).index(preset)
    as_gon = (GON, replaced('unit = "deg"', 'unit = "gon"')) if number % 3 == 0 else ()
    assert listed(block, tmp_path / "delivery", *as_gon) == []
