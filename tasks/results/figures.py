"""The figures of notes and summary.json beyond its contract: one model for writer and readers of each.

``summary.json`` allows fields beyond its contract; a missing figure is None or empty, and the report
says "none".
"""

from __future__ import annotations

from collections.abc import Mapping

from tasks.files.json_text import JSON
from tasks.results.calibration_figures import CalibrationFigures, TwoStepFigure, TwoStepVerdictFigure
from tasks.results.figure import Figure, Values


class GroupFigure(Figure):
    """An observation group; ``sigma0`` is null without redundancy.

    Attributes
    ----------
    observations, uncontrolled : single coordinates and angles used, and those of them without control.
    rows, rejected_rows : points, positions, …, and those with a rejected component; ``rejected`` is the same.
    """

    group: str
    observations: int
    redundancy: float | None = None
    sigma0: float | None = None
    rejected: int = 0
    uncontrolled: int = 0
    rows: int = 0
    rejected_rows: int = 0


class GlobalTestFigure(Figure):
    """Limits of σ0 at a confidence level, and whether it meets them; limits are null without redundancy."""

    lower: float | None = None
    upper: float | None = None
    confidence: float
    passed: bool


class DatumFigure(Figure):
    """A direction of the datum: its σ (m, rad or relative; null if nothing holds it) and what holds it."""

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
    not_determinable: tuple[str, ...] = ()
    groups: tuple[GroupTestFigure, ...] = ()
    flights: tuple[FlightTestFigure, ...] = ()


class GridStepFigure(Figure):
    """After a number of corrections by mean residuals: σ0, the RMS of the means and what chance gives, µm."""

    number: int
    sigma0: float | None = None
    rms_um: float
    noise_um: float


class CrossStepFigure(Figure):
    """The RMS of the mean residuals of images that were not used in their correction, µm."""

    number: int
    mean_rms_um: float
    residual_rms: float


class GridIterationFigure(Figure):
    """Corrections by mean residuals, before the first one and after each."""

    method: str = "means"
    taken: int
    reason: str
    stopped_because: str = ""
    gain: float | None
    steps: tuple[GridStepFigure, ...]
    cross_validation: tuple[CrossStepFigure, ...] = ()


class WithinCellsFigure(Figure):
    """Image errors that vary within the sub-areas of a camera, as residuals show them.

    ``probability``: of as much by chance; ``enough``: number of sub-areas along a side within which residuals
    show no more than chance, null where these are enough or none of those tried.
    """

    rms_um: float
    probability: float
    significant: bool
    enough: int | None


class CameraGridFigure(Figure):
    """Mean residuals of a camera; pairs are x, y.

    ``parts``: into how many the sides of the sub-areas were divided to see what corrections leave within
    them; null where that was not computed. ``within`` is null where nothing was to be corrected.
    """

    camera: str
    columns: int
    rows: int
    residuals: tuple[int, ...]
    known: int
    significant: int
    confidence: float
    expected_by_chance: float
    significant_jointly: int
    largest_um: float | None
    rms_um: Values
    noise_um: Values
    signal_um: Values
    correction_rms_um: Values | None
    image_error_um: float | None = None
    parts: int | None = None
    within: WithinCellsFigure | None = None


class CorrectionErrorsFigure(Figure):
    """How many times as large what corrections leave of image errors makes standard deviations.

    ``heights``: of object points, RMS; ``factor``: of a system parameter, the largest; null if none is free.
    """

    heights: float
    factor: float | None = None
    parameter: str = ""
    entity: str = ""


class ResidualGridFigure(Figure):
    """Mean residuals; ``iteration`` is null where they were not used as corrections.

    ``remaining`` is null where nothing was corrected, or what corrections leave was not computed.
    """

    cameras: tuple[CameraGridFigure, ...] = ()
    iteration: GridIterationFigure | None = None
    remaining: CorrectionErrorsFigure | None = None


class ModelFinding(Figure):
    """One cause of model_alternatives.parquet, the kind without its axis; ``moved_by`` in σ of ``moves``.

    ``alike_points`` are other control points an error of which would look nearly the same.
    """

    rank: int
    quantity: str
    entity: str
    scope: str
    part: str
    t: float
    moves: str
    moved_by: float
    sentence: str
    alike_points: tuple[str, ...] = ()


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
    """A group with what had been rejected, and its σ0 in addition to all findings."""

    group: str
    sigma0: float


class ComponentFigure(Figure):
    """The factor of the stated σ of a part of the observations; limits are null where it is not estimated.

    Its median σ is null and has no unit where its components have several.
    """

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
    """Variance components, and how often the observations were weighted again."""

    rounds: int
    confidence: float
    components: tuple[ComponentFigure, ...]


class CorrelationTimeFigure(Figure):
    """The correlation time of a group, as stated and as used, s; limits are null where there are none.

    ``verdict`` is that of `adjust.quality.correlation_time`; ``tested``: it was estimated.
    """

    group: str
    stated_s: float
    correlation_s: float
    lower_s: float | None = None
    upper_s: float | None = None
    verdict: str
    tested: bool = False


class WeakParameters(Figure):
    """System parameters that the block hardly separates.

    ``correlation``: the largest one between two of them; null of a combination without a strong one.
    """

    parameters: tuple[str, ...]
    entities: tuple[str, ...]
    correlation: float | None = None


class SharedMoments(Figure):
    """Images that several cameras took within a millisecond; ``heads``: of a rig, null of cameras alone."""

    images: int
    moments: int
    heads: int | None = None


class LateHeadFigure(Figure):
    """A head exposed late on a way that is not known well.

    Attributes
    ----------
    offset_s : its synchronisation offset.
    sigma_m, part_of_sigma : what errors of the boresight move it, and that as part of σ of its projection
        centre; of the image with the largest part.
    """

    head: str
    offset_s: float
    sigma_m: float
    part_of_sigma: float


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
    """The grid of a trust map, and σ of its rays.

    Attributes
    ----------
    added_pairs : pairs of images that see a cell, but have no common point, and are not within two exposures
        of each other in a series of correlated errors.
    cells : that are mapped.
    area_cells : cells of the area that was to be mapped; null: no area was given.
    """

    west_m: float
    north_m: float
    cell_m: float
    rows: int
    columns: int
    sigma_image_um: float
    added_pairs: int
    cells: int
    area_cells: int | None = None

    @property
    def unmapped(self) -> int:
        """Cells of the area that are not mapped."""
        return 0 if self.area_cells is None else self.area_cells - self.cells


class TrustMapFigure(Figure):
    """A trust map: values that ``share`` of its cells do not exceed; null where nothing limits them.

    Attributes
    ----------
    cells : that at least two images see, of ``cell_m`` each.
    unmapped : part of the area's cells that are not among them, which count as beyond every limit.
    median_sigma_m, sigma_m : of a point measured in all images, median and at the share; x, y, z.
    pair_sigma_m : at the share, measured in the best pair.
    relative_sigma_m : median of the differences from the next cell.
    external_m : at the share, largest error that an undetected gross error causes, in the new image
        coordinates or in the block; x, y, z.
    block_error_m : at the share, the same of errors in orientations and control points of the block alone.
    ray_error_m : at the share, the same of errors in image points of the block alone.
    uncontrolled : part of the cells in which an image coordinate has no control.
    """

    cells: int
    unmapped: float
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
    ray_error_m: Values
    uncontrolled: float


class StatementPartFigure(Figure):
    """A part of a statement: its points, its outcome, figures and limits in metres, and those beyond."""

    points: str
    number: int
    case: str
    figures_m: Mapping[str, float] = {}
    limits_m: Mapping[str, float] = {}
    exceeded: tuple[str, ...] = ()
    sentence: str = ""


class StatementFigure(Figure):
    """The statement by a standard or an authority's template; ``passed``: the requirement is met."""

    standard: str
    edition: str
    verified: str = ""
    tested: bool
    passed: bool = False
    check_points: int
    check_points_needed: int
    sentence: str
    parts: tuple[StatementPartFigure, ...] = ()


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
    taken_back: int = 0
    given_up_points: tuple[str, ...] = ()
    inseparable_control: tuple[str, ...] = ()
    unrejected_image_points: int = 0
    rejected_control: tuple[str, ...] = ()
    uncontrolled_control: tuple[str, ...] = ()
    sigma_scaled_by: float | None = None
    self_calibration: SelfCalibrationFigures | None = None
    residual_grid: ResidualGridFigure = ResidualGridFigure()
    calibration: CalibrationFigures | None = None
    variance_components: VarianceFigures | None = None
    correlation_times: tuple[CorrelationTimeFigure, ...] | None = None
    weak_parameters: tuple[WeakParameters, ...] = ()
    without_effect: tuple[str, ...] = ()
    shared_moments: SharedMoments | None = None
    late_heads: tuple[LateHeadFigure, ...] = ()
    model_findings: tuple[ModelFinding, ...] = ()
    strip_scatter: tuple[StripScatter, ...] = ()
    restored_groups: tuple[RestoredGroup, ...] = ()
    moved_by_findings: float | None = None
    two_step: tuple[TwoStepFigure, ...] = ()
    two_step_calibration: TwoStepVerdictFigure | None = None
    registered_calibrations: tuple[RegisteredCalibrationFigure, ...] = ()
    trust_map: TrustMapFigure | None = None
    trust_map_grid: TrustMapGrid | None = None
    accuracy_statements: tuple[StatementFigure, ...] = ()
    frame: str = ""


def figures_of(figures: Mapping[str, JSON] | None) -> AdjustmentFigures:
    """The figures in notes or in a summary, those of its contract apart."""
    return AdjustmentFigures.model_validate(figures or {})
