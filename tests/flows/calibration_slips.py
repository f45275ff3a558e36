"""Slips in the delivery of a simulated calibration flight, one row each, and what becomes of each.

Two flights in four directions: 148 exposures of 80 mm at 780 and 2,340 m with 84 control and 40 check points,
and 104 of 120 mm at 1,400 and 3,000 m without check points. Lever arm, GNSS shift, misalignment and interior
orientation differ from what the project states as they do in reality.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.stories.system_calibration import system_calibration
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tasks.simulation.truth_comparison import compare_with_truth

LEVER_ARM = (0.35, -0.12, -1.20)
GEOMETRIES: Mapping[str, tuple[str, ...]] = {
    "wide angle": (
        "points.count=1200",
        "points.detection=0.5",
        "flight.0.lines=3",
        "flight.0.exposures=10",
        "flight.1.lines=3",
        "flight.1.exposures=8",
        "flight.2.exposures=5",
        "flight.3.exposures=5",
        "control.0.extent_m=[2000.0, 1600.0]",
    ),
    "normal angle, no check points": (
        "camera.columns=7680",
        "camera.rows=13824",
        "camera.pixel_um=12.0",
        "camera.focal_length_mm=120.0",
        "points.count=1200",
        "points.detection=0.5",
        "flight.0.height_m=1400.0",
        "flight.0.lines=2",
        "flight.0.exposures=8",
        "flight.1.height_m=1400.0",
        "flight.1.lines=2",
        "flight.1.exposures=8",
        "flight.2.height_m=3000.0",
        "flight.2.exposures=5",
        "flight.3.height_m=3000.0",
        "flight.3.exposures=5",
        "control.0.extent_m=[3000.0, 2400.0]",
        "control.1.control=40",
        "noise.image_um=2.0",
    ),
}
#: How the delivery states the flight when nothing is wrong with it.
STATED = (
    f"cameras.UCE-80.lever_arm_m={list(LEVER_ARM)}",
    'adjustment.rejection={ critical_value = 4.0, test = "observations" }',
    "calibration.held.control_m=0.005",
    "calibration.limits.principal_point_um=2.0",
)

Table = pd.DataFrame
Edit = Callable[[Table], Table]


@dataclass(frozen=True)
class Slip:
    """One slip.

    Attributes
    ----------
    name : in words.
    cause : beginning of the quantity that is named first; empty: none is.
    words : that stand in a reason, where it is (or may be) another kind of evidence that finds it.
    stated : what the project states otherwise.
    flight : what was flown otherwise.
    exposures, control, image_points : what was done to the delivered tables.
    unnoticed : the quantity of which an error stays unnoticed and does the same, where that is so.
    of : the slips of which it consists.
    """

    name: str
    cause: str = ""
    words: str = ""
    stated: tuple[str, ...] = ()
    flight: tuple[str, ...] = ()
    exposures: Edit | None = None
    control: Edit | None = None
    image_points: Edit | None = None
    unnoticed: str = ""
    of: tuple[Slip, ...] = ()


@dataclass(frozen=True)
class Fate:
    """What became of a delivery.

    Attributes
    ----------
    verdict : of the flight; ``input_error`` or ``not_computable`` where there is no calibration.
    reasons : of the verdict.
    first : the quantity of the likeliest model alternative, and where; empty without one.
    alike : what is named as nearly the same as the likeliest.
    worst : largest error of a certified parameter, in its σ; NaN without one.
    errors : of all of them.
    restrictions : of the verdict.
    """

    verdict: str
    reasons: tuple[str, ...] = ()
    first: str = ""
    alike: str = ""
    worst: float = float("nan")
    errors: tuple[float, ...] = field(default=())
    restrictions: tuple[str, ...] = ()


def flown(folder: Path, seed: int, *changes: str, geometry: str = "wide angle") -> Path:
    """A delivered flight: the folder of its project."""
    truth = (f"truth.lever_arm_m={list(LEVER_ARM)}", f"seed={seed}")
    specification = load_simulation("uce-calibration", (*GEOMETRIES[geometry], *truth, *changes))
    simulate_project(specification, folder)
    return folder


def with_slip(project: Path, slip: Slip, folder: Path) -> Path:
    """A copy of a delivery with the slip in its tables."""
    shutil.copytree(project, folder)
    for name in ("exposures", "control", "image_points"):
        edit: Edit | None = getattr(slip, name)
        if edit is not None:
            path = folder / f"{name}.csv"
            table = pd.read_csv(path, dtype={"strip": str, "flight": str, "point": str, "image": str})
            edit(table).to_csv(path, index=False)
    return folder


def fate(project: Path, stated: tuple[str, ...] = ()) -> Fate:
    """Calibrate a delivery and see what becomes of it."""
    outcome = carry_out(
        system_calibration, RunRequest(project / "project.toml", project / "results", (*STATED, *stated))
    )
    return fate_of(outcome, project)


def fate_of(outcome: RunOutcome, project: Path) -> Fate:
    """The same of a run that has ended."""
    if outcome.error is not None:
        return Fate(outcome.summary.status, (str(outcome.error),))
    found = outcome.summary.model_extra["calibration"]
    errors = tuple(
        float(item.t)
        for item in compare_with_truth(project, outcome.directory).parameters
        if not item.parameter.startswith("gnss_strip")
    )
    causes = outcome.summary.model_extra["model_findings"]
    first = " ".join(str(causes[0][key]) for key in ("quantity", "scope", "part")).strip() if causes else ""
    worst = float(np.abs(errors).max()) if errors else float("nan")
    alike = (
        str(causes[0]["sentence"]).partition("Nearly indistinguishable from it: ")[2].partition(".")[0]
        if causes
        else ""
    )
    return Fate(
        found["verdict"], tuple(found["reasons"]), first, alike, worst, errors, tuple(found["restrictions"])
    )


def in_strips(pattern: str) -> Callable[[Table], pd.Series]:
    """Which exposures belong to strips whose names match."""
    return lambda table: table["strip"].str.match(pattern)


HIGH, ONE, NORTH = in_strips("H"), in_strips("E02f$"), in_strips("H?N..f$")
#: The second day: half of the strips of every kind.
SECOND_DAY = in_strips(".*(02f|02r|03f)$")


def added(chosen: Callable[[Table], pd.Series] | None = None, **changes: float) -> Edit:
    """Something added to columns of some of the rows; headings stay below a full turn."""

    def edit(table: Table) -> Table:
        rows = np.ones(len(table), dtype=bool) if chosen is None else chosen(table).to_numpy()
        moved = table.copy()
        for name, value in changes.items():
            moved[name] += np.where(rows, value, 0.0)
            if name == "heading":
                moved[name] %= 360.0
        return moved

    return edit


def in_flight(name: str) -> Callable[[Table], pd.Series]:
    """Which exposures belong to a flight."""
    return lambda table: table["flight"] == name


def later(seconds: float, chosen: Callable[[Table], pd.Series] | None = None) -> Edit:
    """Positions of a moment later."""

    def edit(table: Table) -> Table:
        rows = np.ones(len(table), dtype=bool) if chosen is None else chosen(table).to_numpy()
        moved = table.copy()
        for _, strip in table.groupby("strip"):
            for axis in "xyz":
                speed = np.gradient(strip[axis], strip["time"])
                own = np.where(rows[strip.index], speed * seconds, 0.0)
                moved.loc[strip.index, axis] += own
        return moved

    return edit


def noisy(seed: int, **sigmas: float) -> Edit:
    """More noise in columns of the control points."""

    def edit(table: Table) -> Table:
        random = np.random.default_rng(seed)
        noise = {name: random.normal(0.0, sigma, len(table)) for name, sigma in sigmas.items()}
        is_control = (table["role"] == "control").to_numpy()
        return table.assign(**{name: table[name] + np.where(is_control, e, 0.0) for name, e in noise.items()})

    return edit


def about_the_middle(matrix: np.ndarray) -> Edit:
    """All surveyed points turned, scaled or tilted about their middle."""

    def edit(table: Table) -> Table:
        x = table[["x", "y", "z"]].to_numpy()
        x = (x - x.mean(axis=0)) @ (np.eye(3) + matrix).T + x.mean(axis=0)
        return table.assign(x=x[:, 0], y=x[:, 1], z=x[:, 2])

    return edit


def distorted(k1: float = 0.0, affinity: float = 0.0) -> Edit:
    """Image points with radial distortion k1 (per mm²), or a stretch of x."""

    def edit(table: Table) -> Table:
        r2 = table["x"] ** 2 + table["y"] ** 2
        return table.assign(x=table["x"] * (1.0 + k1 * r2 + affinity), y=table["y"] * (1.0 + k1 * r2))

    return edit


def longer(part: float) -> Edit:
    """Image points of the high strips as a longer focal length has them."""

    def edit(table: Table) -> Table:
        factor = 1.0 + part * table["image"].str.startswith("H")
        return table.assign(x=table["x"] * factor, y=table["y"] * factor)

    return edit


def one_control_point(table: Table) -> pd.Series:
    return table["point"] == table["point"].iloc[40]


def half_of_control(table: Table) -> pd.Series:
    return table["x"] > table["x"].median()


_ARM = "cameras.UCE-80.lever_arm_m={}"
_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
_TILT = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
_SCALE = np.diag([1.0, 1.0, 0.0])

SLIPS: tuple[Slip, ...] = (
    Slip("lever arm with flipped sign", "lever_arm", stated=(_ARM.format([-v for v in LEVER_ARM]),)),
    Slip("lever arm forward-left-up", "lever_arm", stated=(_ARM.format([0.35, 0.12, 1.20]),)),
    Slip("lever arm forgotten", "lever_arm", stated=(_ARM.format([0.0, 0.0, 0.0]),)),
    Slip("lever arm 10 cm wrong along x", "lever_arm", stated=(_ARM.format([0.45, -0.12, -1.20]),)),
    Slip("lever arm 10 cm wrong along y", "lever_arm", stated=(_ARM.format([0.35, -0.02, -1.20]),)),
    Slip("lever arm x and y swapped", "lever_arm", stated=(_ARM.format([-0.12, 0.35, -1.20]),)),
    Slip("mount_deg 180", words="mount_deg", stated=("cameras.UCE-80.mount_deg=180",)),
    Slip("10 ms late", "time_offset", exposures=later(0.010)),
    Slip("2 ms late", "time_offset", exposures=later(0.002)),
    Slip("10 ms late in the high strips", "principal_point height", exposures=later(0.010, HIGH)),
    Slip("high strips 10 cm too high", exposures=added(HIGH, z=0.10), unnoticed="gnss_shift_z"),
    Slip("high strips 30 cm to the east", "gnss_shift height", exposures=added(HIGH, x=0.30)),
    Slip("one direction 20 cm to the east", "gnss_shift direction", exposures=added(NORTH, x=0.20)),
    Slip(
        "one strip 50 cm too high", "gnss_shift strip", "GNSS strip bias z", exposures=added(ONE, z=0.50)
    ),
    Slip("one strip turned by 0.05°", "boresight strip", exposures=added(ONE, heading=0.05)),
    Slip("control heights orthometric", words="height systems", control=added(z=-33.0)),
    Slip("control 30 cm too high", control=added(z=0.30), unnoticed="control_shift_z"),
    Slip("control noise 10 cm", words="control points", control=noisy(1, x=0.10, y=0.10, z=0.10)),
    Slip("control scale 200 ppm", "control_scale", control=about_the_middle(2e-4 * _SCALE)),
    Slip("control turned by 0.01°", "control_turn", control=about_the_middle(1.7e-4 * _TURN)),
    Slip("control tilted by 0.01°", "control_tilt", control=about_the_middle(1.7e-4 * _TILT)),
    Slip("one control point 1 m wrong", control=added(one_control_point, x=1.0)),
    Slip("half of the control 10 cm wrong", "control_tilt", control=added(half_of_control, z=0.10)),
    Slip("remounted by 0.02°", "boresight", exposures=added(SECOND_DAY, pitch=0.02)),
    Slip("remounted by 0.02° about the vertical", "boresight", exposures=added(SECOND_DAY, heading=0.02)),
    Slip("remounted by 0.004°", "boresight", "pitch varies", exposures=added(SECOND_DAY, pitch=0.004)),
    Slip("image σ five times too large", words="image points", stated=("inputs.image_points.sigma=0.006",)),
    Slip("image σ five times too small", words="image points", stated=("inputs.image_points.sigma=0.00024",)),
    Slip("refraction applied twice", "refraction", stated=('adjustment.refraction="standard"',)),
    Slip("radial distortion of 5 µm", "brown", image_points=distorted(k1=5e-3 / 40.0**3)),
    Slip("affinity of 100 ppm", "brown", image_points=distorted(affinity=1e-4)),
    Slip("focal length 20 µm longer above", "focal_length", image_points=longer(20e-3 / 80.0)),
    Slip("GNSS σ five times too small", words="GNSS", stated=("inputs.exposures.sigma.position_m=0.01",)),
    Slip(
        "INS σ five times too small",
        words="INS",
        stated=("inputs.exposures.sigma.attitude_deg=[0.0006, 0.0006, 0.0016]",),
    ),
    Slip("a failed gate", words="gate", stated=("gates.sigma0.max=0.5",)),
)  # fmt: skip


def _both(first: str, second: str) -> Slip:
    """Two slips in one delivery."""
    one, other = (next(slip for slip in SLIPS if slip.name == name) for name in (first, second))
    edits: dict[str, Edit] = {}
    for name in ("exposures", "control", "image_points"):
        for edit in filter(None, (getattr(one, name), getattr(other, name))):
            edits[name] = _after(edits[name], edit) if name in edits else edit
    return Slip(f"{first}, {second}", stated=(*one.stated, *other.stated), of=(one, other), **edits)


def _after(first: Edit, second: Edit) -> Edit:
    return lambda table: second(first(table))


PAIRS: tuple[Slip, ...] = (
    _both("lever arm 10 cm wrong along x", "2 ms late"),
    _both("lever arm with flipped sign", "control 30 cm too high"),
    _both("lever arm forgotten", "remounted by 0.02°"),
    _both("lever arm 10 cm wrong along y", "one control point 1 m wrong"),
    _both("10 ms late", "lever arm x and y swapped"),
    _both("high strips 10 cm too high", "focal length 20 µm longer above"),
    _both("high strips 10 cm too high", "control noise 10 cm"),
    _both("one strip 50 cm too high", "one strip turned by 0.05°"),
    _both("control tilted by 0.01°", "control scale 200 ppm"),
    _both("control turned by 0.01°", "remounted by 0.02° about the vertical"),
    _both("remounted by 0.004°", "INS σ five times too small"),
    _both("refraction applied twice", "radial distortion of 5 µm"),
    _both("image σ five times too large", "lever arm 10 cm wrong along x"),
    _both("image σ five times too large", "focal length 20 µm longer above"),
    _both("GNSS σ five times too small", "one direction 20 cm to the east"),
)
