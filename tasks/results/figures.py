"""The figures of notes and summary.json beyond its contract: one model for who writes and who reads each.

``summary.json`` allows fields beyond its contract; a figure that a run does not have is None or empty, and
the report says "none".
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias, cast

from pydantic import BaseModel, ConfigDict

from tasks.files.json_text import JSON

#: A number for each axis, camera or step; null where there is none.
Values: TypeAlias = tuple[float | None, ...]


class Figure(BaseModel):
    """Base of the figures: immutable; figures of later versions are passed over."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    def to_json(self) -> Mapping[str, JSON]:
        """As it stands in notes and summary.json."""
        return cast(Mapping[str, JSON], self.model_dump(mode="json"))


class GroupFigure(Figure):
    """An observation group; ``sigma0`` is null without redundancy."""

    group: str
    observations: int
    redundancy: float | None = None
    sigma0: float | None = None
    rejected: int = 0
    uncontrolled: int = 0


class GlobalTestFigure(Figure):
    """Limits of σ0 at a confidence level, and whether it keeps them; limits are null without redundancy."""

    lower: float | None = None
    upper: float | None = None
    confidence: float
    passed: bool


class DatumFigure(Figure):
    """A direction of the datum: its σ (m, rad or relative; null if nothing holds it) and who holds it."""

    direction: str
    sigma: float | None = None
    held_by: Mapping[str, float] = {}


class LeftOutFigure(Figure):
    """Control points predicted without their fold; null where none of them is known."""

    folds: int
    points: int
    rmse_m: Values
    max_m: Values
    rms_over_sigma: Values


class FreeNetworkFigure(Figure):
    """The open directions of the datum of a free network, and whose approximate values fix them."""

    inner_constraints: str
    defect: int
    open: tuple[str, ...] = ()


class FTestFigure(Figure):
    """An F-test of additional parameters, with the limit and the probability by chance."""

    parameters: int
    statistic: float
    critical: float
    probability: float


class GroupTestFigure(FTestFigure):
    """Of a group of additional parameters against zero, all of them together."""

    group: str
    significant: bool


class FlightTestFigure(FTestFigure):
    """Whether the additional parameters of one camera differ between two flights."""

    first: str
    second: str
    differ: bool


class DecisionFigure(Figure):
    """What was decided about an additional parameter, and why."""

    parameter: str
    action: str
    reason: str


class SelfCalibrationFigures(Figure):
    """Self-calibration: what was selected, how it was reduced, and the tests of groups and of flights."""

    parameters: str
    elimination: str
    offered: int
    kept: int
    sigma0_of_all: float | None = None
    decisions: tuple[DecisionFigure, ...] = ()
    groups: tuple[GroupTestFigure, ...] = ()
    flights: tuple[FlightTestFigure, ...] = ()


class GridStepFigure(Figure):
    """After a number of corrections by mean residuals: σ0, the RMS of the means and what chance gives, µm."""

    number: int
    sigma0: float | None = None
    rms_um: float
    noise_um: float


class CrossStepFigure(Figure):
    """The RMS of the mean residuals of images that took no part in their correction, µm."""

    number: int
    mean_rms_um: float
    residual_rms: float


class GridIterationFigure(Figure):
    """Corrections by mean residuals, before the first one and after each."""

    taken: int
    reason: str
    stopped_because: str
    gain: float | None
    steps: tuple[GridStepFigure, ...]
    cross_validation: tuple[CrossStepFigure, ...] = ()


class CameraGridFigure(Figure):
    """Mean residuals of a camera; pairs are x, y."""

    camera: str
    columns: int
    rows: int
    residuals: tuple[int, ...]
    known: int
    significant: int
    expected_by_chance: float
    significant_jointly: int
    largest_um: float | None
    rms_um: Values
    noise_um: Values
    signal_um: Values
    correction_rms_um: Values | None


class ResidualGridFigure(Figure):
    """Mean residuals; ``iteration`` is null where they were not used as corrections."""

    cameras: tuple[CameraGridFigure, ...] = ()
    iteration: GridIterationFigure | None = None


class CalibrationVerdictFigure(Figure):
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


class ReleaseFigure(Figure):
    """What was free at one stage of a calibration, and what was held after it."""

    free: tuple[str, ...]
    additional: str
    held: Mapping[str, str] = {}


class ComparedStepFigure(Figure):
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


class StepComparisonFigure(Figure):
    """The two methods compared."""

    parameters: tuple[ComparedStepFigure, ...]
    chi_squared: float
    freedom: int
    probability: float
    sentence: str


class OffsetFigure(Figure):
    """Lever arm and shift; of the means of strips each by itself, all three components."""

    lever_arm_m: Values
    lever_arm_sigma_m: Values
    shift_m: Values
    shift_sigma_m: Values


class SeparatedFigure(OffsetFigure):
    """Lever arm (the whole one) and shift in plan, estimated together."""

    freedom: int


class StripGroupFigure(OffsetFigure):
    """Means of a group of strips by the second step."""

    images: int
    boresight_deg: Values
    boresight_sigma_deg: Values
    freedom: Values


class CameraAxesFigure(Figure):
    """Adjusted − observed along x (columns), y (against rows), z of the camera."""

    rotation_deg: Values
    offset_m: Values


class MountingFigure(StripGroupFigure):
    """A mounting; 0 is that of most strips."""

    mounting: int
    strips: tuple[str, ...]
    adjusted_minus_observed_in_camera_axes: CameraAxesFigure


class FlightFigure(StripGroupFigure):
    """A flight, by the strips with the mounting that most of them have."""

    mounting: int
    flight: str


class OffsetTestFigure(Figure):
    """A nested test; null where the strips do not say anything about it."""

    tested: str
    chi_squared: float | None = None
    freedom: int
    variance_freedom: int
    probability: float | None = None


class TwoStepFigure(StripGroupFigure):
    """The second step for one camera; the means are those of its main mounting, ``images`` are all."""

    camera: str
    strips: int
    directions: int
    images_of_main_mounting: int
    mountings_tested: bool
    mountings: tuple[MountingFigure, ...]
    other_mountings: tuple[MountingFigure, ...]
    flights: tuple[FlightFigure, ...]
    offset_fixed_in: str
    offset_sentence: str
    offset_rms_body_m: float | None
    offset_rms_map_m: float | None
    separated: SeparatedFigure
    tests: tuple[OffsetTestFigure, ...]
    adjusted_minus_observed_in_camera_axes: Mapping[str, CameraAxesFigure]


class TwoStepParameterFigure(Figure):
    """A parameter of a two-step calibration by itself."""

    parameter: str
    camera: str
    unit: str
    value: float | None = None
    sigma: float | None = None
    limit: float
    verdict: str
    because: str = ""


class TwoStepVerdictFigure(Figure):
    """The verdict on a two-step calibration by itself."""

    verdict: str
    sentence: str
    reasons: tuple[str, ...] = ()
    restrictions: tuple[str, ...] = ()
    parameters: tuple[TwoStepParameterFigure, ...]


class CalibrationFigures(Figure):
    """A system calibration; ``held`` as in its record, ``two_step`` null without a second step."""

    verdict: str
    reasons: tuple[str, ...] = ()
    restrictions: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    directions: str
    heights: str
    parameters: tuple[CalibrationVerdictFigure, ...]
    held: tuple[Mapping[str, str | float], ...] = ()
    releases: tuple[ReleaseFigure, ...]
    two_step: StepComparisonFigure | None = None


class ModelFinding(Figure):
    """One cause of model_alternatives.parquet, the kind without its axis; ``moved_by`` in σ of ``moves``."""

    rank: int
    quantity: str
    entity: str
    scope: str
    part: str
    t: float
    moves: str
    moved_by: float
    sentence: str


class StripScatter(Figure):
    """A quantity that differs from strip to strip beyond its σ, and how far that moves a parameter, in σ."""

    quantity: str
    entity: str
    unit: str
    strips: int
    statistic: float
    freedom: int
    probability: float
    scatter: float
    moved_by: float


class RestoredGroup(Figure):
    """A group with what had been rejected, and its σ0 beside all findings."""

    group: str
    sigma0: float


class ComponentFigure(Figure):
    """The factor of the stated σ of a part of the observations; limits are null where it is not estimated."""

    part: str
    estimated: bool
    factor: float | None
    factor_lower: float | None
    factor_upper: float | None
    sigma: float | None
    unit: str
    redundancy: float | None
    degrees_of_freedom: float | None


class VarianceFigures(Figure):
    """Variance components, and how often the observations were weighted anew."""

    rounds: int
    confidence: float
    components: tuple[ComponentFigure, ...]


class RegisteredCalibrationFigure(Figure):
    """Whether the block contradicts the calibration of the registry that a camera has: the test T."""

    camera: str
    use: str
    parameters: int
    statistic: float
    freedom: int
    probability: float
    contradicted: bool


class TrustMapGrid(Figure):
    """The grid of a trust map, and σ of its rays; ``added_pairs`` see a cell, but no common point."""

    west_m: float
    north_m: float
    cell_m: float
    rows: int
    columns: int
    sigma_image_um: float
    added_pairs: int


class TrustMapFigure(Figure):
    """A trust map: values that ``share`` of its cells do not exceed; null where nothing limits them.

    Attributes
    ----------
    cells : that at least two images see, of ``cell_m`` each.
    median_sigma_m, sigma_m : of a point measured in all images, median and at the share; x, y, z.
    pair_sigma_m : at the share, measured in the best pair.
    relative_sigma_m : median of the differences from the next cell.
    external_m : at the share, largest error that an undetected gross error causes, in the new image
        coordinates or in the block; x, y, z.
    block_error_m : at the share, the same of errors in the block alone.
    uncontrolled : part of the cells in which an image coordinate has no control.
    """

    cells: int
    cell_m: float
    share: float
    sigma_image_um: float
    median_rays: float
    median_sigma_m: Values
    sigma_m: Values
    pair_sigma_m: Values
    relative_sigma_m: Values
    external_m: Values
    block_error_m: Values
    uncontrolled: float


class AdjustmentFigures(Figure):
    """Figures of the adjustment beyond the contract of summary.json."""

    groups: tuple[GroupFigure, ...] = ()
    global_test: GlobalTestFigure | None = None
    datum: tuple[DatumFigure, ...] = ()
    k_fold: LeftOutFigure | None = None
    free_network: FreeNetworkFigure | None = None
    image_rms_px: Values | None = None
    critical_value: float | None = None
    rejected_per_pass: tuple[int, ...] = ()
    sigma_scaled_by: float | None = None
    self_calibration: SelfCalibrationFigures | None = None
    residual_grid: ResidualGridFigure = ResidualGridFigure()
    calibration: CalibrationFigures | None = None
    variance_components: VarianceFigures | None = None
    model_findings: tuple[ModelFinding, ...] = ()
    strip_scatter: tuple[StripScatter, ...] = ()
    restored_groups: tuple[RestoredGroup, ...] = ()
    moved_by_findings: float | None = None
    two_step: tuple[TwoStepFigure, ...] = ()
    two_step_calibration: TwoStepVerdictFigure | None = None
    registered_calibrations: tuple[RegisteredCalibrationFigure, ...] = ()
    trust_map: TrustMapFigure | None = None
    trust_map_grid: TrustMapGrid | None = None
    frame: str = ""


def figures_of(figures: Mapping[str, JSON] | None) -> AdjustmentFigures:
    """The figures in notes or in a summary, those of its contract apart."""
    return AdjustmentFigures.model_validate(figures or {})
