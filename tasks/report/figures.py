"""The figures of the adjustment's notes that the report shows, with their types.

``summary.json`` allows fields beyond its contract; here stands what the report expects of them. A figure that
is missing is None or empty, and the report says "none".
"""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel, ConfigDict


class _Figure(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")


class GroupFigure(_Figure):
    """An observation group; ``sigma0`` is null without redundancy."""

    group: str
    observations: int
    redundancy: float | None = None
    sigma0: float | None = None
    rejected: int = 0
    uncontrolled: int = 0


class GlobalTestFigure(_Figure):
    """Limits of σ0 at a confidence level, and whether it keeps them; limits are null without redundancy."""

    lower: float | None = None
    upper: float | None = None
    confidence: float
    passed: bool


class DatumFigure(_Figure):
    """A direction of the datum: its σ (m, rad or relative; null if nothing holds it) and who holds it."""

    direction: str
    sigma: float | None = None
    held_by: Mapping[str, float] = {}


class LeftOutFigure(_Figure):
    """Control points predicted without their fold; null where none of them is known."""

    folds: int
    points: int
    rmse_m: tuple[float | None, ...]


class FreeNetworkFigure(_Figure):
    """The open directions of the datum of a free network, and whose approximate values fix them."""

    inner_constraints: str
    defect: int
    open: tuple[str, ...] = ()


class GroupTestFigure(_Figure):
    """F-test of a group of additional parameters against zero, all of them together."""

    group: str
    parameters: int
    statistic: float
    critical: float
    probability: float
    significant: bool


class FlightTestFigure(_Figure):
    """F-test whether the additional parameters of one camera differ between two flights."""

    first: str
    second: str
    parameters: int
    statistic: float
    critical: float
    probability: float
    differ: bool


class SelfCalibrationFigures(_Figure):
    """Self-calibration: what was selected, how it was reduced, and the tests of groups and of flights."""

    parameters: str
    elimination: str
    offered: int
    kept: int
    sigma0_of_all: float | None = None
    groups: tuple[GroupTestFigure, ...] = ()
    flights: tuple[FlightTestFigure, ...] = ()


class GridStepFigure(_Figure):
    """After a number of corrections by mean residuals: σ0, the RMS of the means and what chance gives, µm."""

    number: int
    sigma0: float | None = None
    rms_um: float
    noise_um: float


class CrossStepFigure(_Figure):
    """The RMS of the mean residuals of images that took no part in their correction, µm."""

    number: int
    mean_rms_um: float


class GridIterationFigure(_Figure):
    """Corrections by mean residuals, before the first one and after each."""

    taken: int
    stopped_because: str
    steps: tuple[GridStepFigure, ...]
    cross_validation: tuple[CrossStepFigure, ...] = ()


class ResidualGridFigure(_Figure):
    """Mean residuals; ``iteration`` is null where they were not used as corrections."""

    iteration: GridIterationFigure | None = None


class CalibrationVerdictFigure(_Figure):
    """What a flight says about one parameter; numbers in the unit of parameters.parquet."""

    parameter: str
    entity: str
    verdict: str
    because: str = ""
    sigma: float | None = None
    limit: float | None = None
    sigma_over_prior: float | None = None
    correlated_with: str | None = None
    correlation: float | None = None


class ReleaseFigure(_Figure):
    """What was free at one stage of a calibration, and what was held after it."""

    free: tuple[str, ...]
    additional: str
    held: Mapping[str, str] = {}


class ComparedStepFigure(_Figure):
    """A parameter by one-step and by two-step calibration."""

    parameter: str
    entity: str
    unit: str
    one_step: float
    one_step_sigma: float
    two_step: float
    two_step_sigma: float
    difference: float
    t: float


class StepComparisonFigure(_Figure):
    """The two methods compared."""

    parameters: tuple[ComparedStepFigure, ...]
    sentence: str


class StripGroupFigure(_Figure):
    """Means of a group of strips by the second step."""

    images: int
    boresight_deg: tuple[float | None, ...]
    boresight_sigma_deg: tuple[float | None, ...]
    lever_arm_m: tuple[float | None, ...]
    lever_arm_sigma_m: tuple[float | None, ...]
    shift_m: tuple[float | None, ...]
    shift_sigma_m: tuple[float | None, ...]


class MountingFigure(StripGroupFigure):
    """A mounting; 0 is that of most strips."""

    mounting: int
    strips: tuple[str, ...]


class FlightFigure(StripGroupFigure):
    """A flight, by the strips with the mounting that most of them have."""

    mounting: int
    flight: str


class OffsetTestFigure(_Figure):
    """A nested test; null where the strips do not say anything about it."""

    tested: str
    chi_squared: float | None = None
    freedom: int
    variance_freedom: int
    probability: float | None = None


class TwoStepFigure(_Figure):
    """The second step for one camera."""

    camera: str
    images: int
    strips: int
    directions: int
    offset_sentence: str
    mountings: tuple[MountingFigure, ...]
    flights: tuple[FlightFigure, ...]
    tests: tuple[OffsetTestFigure, ...]


class TwoStepParameterFigure(_Figure):
    """A parameter of a two-step calibration by itself."""

    parameter: str
    camera: str
    unit: str
    value: float | None = None
    sigma: float | None = None
    limit: float
    verdict: str
    because: str = ""


class TwoStepVerdictFigure(_Figure):
    """The verdict on a two-step calibration by itself."""

    verdict: str
    sentence: str
    reasons: tuple[str, ...] = ()
    restrictions: tuple[str, ...] = ()
    parameters: tuple[TwoStepParameterFigure, ...]


class TwoStepCalibrationFigures(_Figure):
    """Figures of a two-step calibration by itself."""

    two_step: tuple[TwoStepFigure, ...]
    two_step_calibration: TwoStepVerdictFigure


class CalibrationFigures(_Figure):
    """A system calibration; ``two_step`` is null without a second step."""

    verdict: str
    reasons: tuple[str, ...] = ()
    directions: str
    heights: str
    parameters: tuple[CalibrationVerdictFigure, ...]
    releases: tuple[ReleaseFigure, ...]
    two_step: StepComparisonFigure | None = None


class MovingFigure(_Figure):
    """A significant error of the model: by how many of its σ it moves a parameter at most."""

    moved_by: float


class RegisteredCalibrationFigure(_Figure):
    """Whether the block contradicts the calibration of the registry that a camera has: the test T."""

    camera: str
    use: str
    parameters: int
    statistic: float
    freedom: int
    probability: float
    contradicted: bool


class AdjustmentFigures(_Figure):
    """Figures of the adjustment beyond the contract of summary.json."""

    groups: tuple[GroupFigure, ...] = ()
    global_test: GlobalTestFigure | None = None
    datum: tuple[DatumFigure, ...] = ()
    k_fold: LeftOutFigure | None = None
    free_network: FreeNetworkFigure | None = None
    image_rms_px: tuple[float | None, ...] | None = None
    critical_value: float | None = None
    rejected_per_pass: tuple[int, ...] = ()
    sigma_scaled_by: float | None = None
    self_calibration: SelfCalibrationFigures | None = None
    residual_grid: ResidualGridFigure = ResidualGridFigure()
    calibration: CalibrationFigures | None = None
    model_findings: tuple[MovingFigure, ...] = ()
    strip_scatter: tuple[MovingFigure, ...] = ()
    moved_by_findings: float | None = None
    two_step: tuple[TwoStepFigure, ...] = ()
    registered_calibrations: tuple[RegisteredCalibrationFigure, ...] = ()
    frame: str = ""


_WORDS = {
    "image_points": "image points",
    "control_points": "control points",
    "gnss_positions": "GNSS positions",
    "ins_attitudes": "INS attitudes",
}


def group_words(name: str) -> str:
    """The name of an observation group for people."""
    plain = _WORDS.get(name, name.replace("_", " ").replace("gnss", "GNSS"))
    return plain.replace("prior:", "priors: ")


_GATE_WORDS = {
    "sigma0": "σ0",
    "rmse_control_m": "RMS at control points",
    "rmse_check_m": "RMS at check points",
    "check_over_limit": "check points over their limits",
    "max_check_m": "largest difference at check points",
    "direct_georeferencing_rmse_m": "RMS at check points georeferenced directly",
    "direct_georeferencing_max_m": "largest difference at check points georeferenced directly",
    "y_parallax_rms_um": "RMS of the y-parallaxes",
    "y_parallax_max_um": "largest y-parallax",
    "registered_calibration": "agreement with the calibration of the registry",
    "missed_limits_of_calibration": "missed limits of a calibration flight",
}


def gate_words(name: str) -> str:
    """The name of a limit for people; one of a component ends with its axis."""
    for known, words in _GATE_WORDS.items():
        if name == known:
            return words
        if name.startswith(f"{known}_"):
            return f"{words}, {name.removeprefix(known).lstrip('_')}"
    return name.replace("_", " ")
