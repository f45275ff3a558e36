"""Settings of the adjustment: what is free, how gross errors are rejected, how precision is stated.

With the tables of [adjustment]: self-calibration by additional parameters, mean residuals of the images in
sub-areas and their use as corrections, and observations of a type that another installed package adds.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

from pydantic import AfterValidator, Field, model_validator

from adjust.camera.additional.register import REGISTER
from adjust.camera.additional.selection import NOTHING, selected
from adjust.errors import AdditionalParametersError, ExtensionError
from adjust.extensions import Extended, trouble_of_function
from tasks.quantities import KINDS
from tasks.settings.base import InputPath, InputPaths, Settings, one_of, trouble
from tasks.settings.coordinates import Positive, PositivePair, PositiveTriple, Real, Whole

if TYPE_CHECKING:
    FreeParameter: TypeAlias = str
else:
    FreeParameter = Literal[tuple(KINDS)]
VarianceDivision: TypeAlias = Literal["file", "camera", "flight"]
ObservedGroup: TypeAlias = Literal["gnss", "ins", "control"]
#: Sub-areas along each side that collocation can have, for its matrices.
MOST_COLLOCATED = 36
#: What makes observations of a type, by its name; see `tasks.block.assembled_block` for its signature.
OBSERVATION_TYPES: Extended[object] = Extended("observations", {}, trouble_of_function)


class OwnObservationsInput(Settings):
    """Observations of a type that an installed package adds."""

    type: Annotated[str, AfterValidator(one_of(OBSERVATION_TYPES, "observation type"))]
    """Name of the type, as the package offers it in its entry points `aerocal.observations`
    ([how](library.md#your-own-observations-parameters-and-formats)).
    """
    file: InputPath
    """The file with the observations; the package states its format."""
    options: Mapping[str, bool | int | float | str] = Field(default={})
    """Values required by the package."""


class ResidualGridSettings(Settings):
    """Mean residuals of all images of a camera in sub-areas of the image."""

    cells: Annotated[Whole, Field(ge=1, le=100)] | None = None
    """Sub-areas along each side of the image. Default 25, or fewer: a sub-area has 25 image points on
    average, and with the method `collocation` several cameras have at most 700 sub-areas together. A camera
    in `file` always has those of the file. Seams between CCD images (`tiles` of the camera) are always
    borders.
    """
    file: InputPaths = ()
    """`residual_grid.parquet` of another run, such as the high flight of the same camera: its corrections
    (its mean residuals, if it applied none) are added to the image coordinates. Several are averaged, each
    mean weighted with the number of its residuals over their mean variance.
    """
    iterations: Annotated[Whole, Field(ge=0, le=50)] = 0
    """Maximum number of times that the image coordinates are corrected and the block is adjusted again; 0:
    mean residuals are only computed. 3 to 5 iterations are usual. The standard deviations include what the
    corrections leave of image errors, up to 1,300 sub-areas.
    """
    method: Literal["means", "collocation"] = "means"
    """How corrections follow from the mean residuals. `means`: the means are added. `collocation`: the most
    probable image errors are estimated through the normal equations, including what orientations and object
    points have absorbed of them. The latter is much more accurate where control and GNSS are sparse; it needs
    at most 36 `cells` and no `file`.
    """
    cross_validation: bool = True
    """Whether corrections are first tested with halves of the images. They are omitted if they do not reduce
    the mean residuals of the images that were not used for them.
    """
    smoothing: Literal["none", "gaussian", "counts", "collocation"] = "counts"
    """Smoothing of the means before they are added, with the method `means`: `none`; `gaussian`; `counts`, a
    Gaussian in which each mean is weighted with its number of image points; `collocation` (least squares,
    determines its own width). No smoothing extends across a seam.
    """
    smoothing_width: Positive = 0.04
    """Standard deviation of the Gaussian as a fraction of the side of the image; 0.04 is one of 25 sub-areas.
    """
    interpolation: Literal["bilinear", "cell"] = "bilinear"
    """Correction of an image point: `bilinear` between the centres of the sub-areas, or constant in each
    `cell`.
    """

    @model_validator(mode="after")
    def _collocation_is_possible(self) -> ResidualGridSettings:
        if self.method != "collocation":
            return self
        if self.iterations == 0:
            raise trouble(
                "The method `collocation` corrects nothing with 0 iterations.",
                "Set `iterations`, for instance to 5, or leave out `method`.",
            )
        if self.file:
            raise trouble(
                "The method `collocation` determines all corrections from this block; those of `file` would "
                "be lost.",
                "Leave out `file`, or set `method` to `means`.",
            )
        if self.cells is not None and self.cells > MOST_COLLOCATED:
            raise trouble(
                f"{self.cells} × {self.cells} sub-areas are too many for the method `collocation`.",
                f"Set `cells` to at most {MOST_COLLOCATED}.",
            )
        return self


def _known_selection(text: str) -> str:
    """A selection the register can read."""
    try:
        selected(text, REGISTER)
    except ExtensionError as error:
        raise trouble(str(error), "Repair that package, or use another set.") from error
    except AdditionalParametersError as error:
        raise trouble(
            f"The additional parameters '{text}' are not known: {error}",
            'Write for example "bluh:1-12"; docs/additional-parameters.md lists all sets.',
        ) from error
    return text.strip()


Selection: TypeAlias = Annotated[str, AfterValidator(_known_selection)]


class SelfCalibrationSettings(Settings):
    """Self-calibration by additional parameters."""

    parameters: Selection = NOTHING
    """Additional parameters to estimate, e.g. `"bluh:1-12"`, `"bluh:1-12+42-73+81-88"`, `"brown:K1,K2"`,
    `"brown-forward:k1-k3,p1,p2"`, `"legendre(5)"`; `"none"` for none. Focal length and principal point are
    listed in `free`.
    """
    per: Literal["camera", "flight"] = "camera"
    """Whether each `camera` has its own set, or each camera in each `flight`. With `flight`, a test shows
    whether the sets differ.
    """
    sigma_um: Positive | None = None
    """Standard deviation of each parameter about its given value, expressed as its largest effect in the
    image, µm. Default: no prior.
    """
    elimination: Literal["default", "bluh", "dmc_certificate", "none"] = "default"
    """Rule by which parameters that are not significant, or not separable from others, are eliminated one
    after another: `default` (correlation 0.90, total correlation 0.975, t of 99 %), `bluh` (t below 1,
    correlations above 0.85), `dmc_certificate` (t below 1.96), or `none`.
    """


class Rejection(Settings):
    """Rejection of gross errors."""

    critical_value: Annotated[Real, Field(gt=1.0, allow_inf_nan=False)] | None = 4.13
    """Observations whose standardized residual exceeds it are rejected. Written as `rejection = {
    critical_value = 4.13 }`, or `rejection = "none"`. Default 4.13: one false alarm in 20 blocks of 1,500
    observations; 3.29 means one in 1,000 observations. If the value is too small, the results look better
    than they are.
    """
    test: Literal["components", "observations"] = "components"
    """Test statistic: `components` (the largest standardized residual of an observation) or `observations`
    (both coordinates of an image point, or all three of a control point, together, converted to a normal
    variable of the same probability). With `observations`, the rate of false alarms corresponds to the
    critical value; with `components`, it is up to two or three times as high.
    """
    reference_variance: Literal["a_priori", "a_posteriori"] = "a_priori"
    """The σ0 of the tests: `a_priori` (1) or `a_posteriori` (from the residuals; the τ-test), for deliveries
    whose σ are not reliable.
    """
    robust: Literal["huber", "cauchy", "tukey", "biber", "danish"] | None = None
    """Weight function of a robust estimation that searches for gross errors before the tests; for blocks with
    very many wrong observations. It is used only for detection; no observation is down-weighted in the
    results.
    """

    @model_validator(mode="before")
    @classmethod
    def _from_text(cls, value: object) -> object:
        if value == "none":
            return {"critical_value": None}
        if isinstance(value, dict | Rejection):
            return value
        raise trouble("The value of rejection is not valid.", 'Write "none" or { critical_value = 4.13 }.')


class Priors(Settings):
    """Standard deviations of directly observed parameters; a parameter without one is not observed."""

    boresight_deg: PositiveTriple | None = None
    """Boresight roll, pitch, yaw about its initial value, degrees; one number or three."""
    lever_arm_m: PositiveTriple | None = None
    """Lever arm about its initial value (body axes), m; one number or three."""
    gnss_shift_m: PositiveTriple | None = None
    """GNSS shift of a flight about zero, m; one number or three."""
    gnss_strip_bias_m: PositiveTriple = (0.03, 0.03, 0.03)
    """GNSS bias of a strip about the shift of its flight, m; one number or three. Default 0.03 m: the part of
    slowly changing GNSS errors that is common to a strip.
    """
    gnss_drift_m_s: PositiveTriple | None = None
    """GNSS drift of a strip about zero, m/s; one number or three."""
    ins_strip_bias_deg: PositiveTriple | None = None
    """INS bias of a strip (roll, pitch, yaw) about zero, degrees; one number or three."""
    ins_drift_deg_s: PositiveTriple | None = None
    """INS drift of a strip about zero, degrees per second; one number or three."""
    time_offset_s: Positive | None = None
    """Time offset between exposures and trajectory about zero, s."""
    focal_length_mm: Positive | None = None
    """Focal length about the camera's value, mm."""
    principal_point_mm: PositivePair | None = None
    """Principal point x, y about the camera's value, mm; one number or two."""
    relative_position_m: PositiveTriple | None = None
    """Relative position of the heads of a rig about `position_m`, m; one number or three."""
    relative_rotation_deg: PositiveTriple | None = None
    """Relative rotation of the heads of a rig about `rotation_deg`, degrees; one number or three."""
    synchronisation_offset_s: Positive | None = None
    """Synchronisation offset of the heads of a rig about the stated one, s."""


class AdjustmentSettings(Settings):
    """The bundle adjustment."""

    free: tuple[FreeParameter, ...] = ()
    """System parameters to estimate, e.g. `["boresight", "lever_arm"]`; all others are held fixed at their
    given values.
    """
    observe: tuple[ObservedGroup, ...] = ("gnss", "ins", "control")
    """Observations used in the adjustment in addition to the image points. Without `gnss` or `ins`, the
    exposures still give approximate values; without `control`, the control points become check points.
    """
    self_calibration: SelfCalibrationSettings = Field(default_factory=SelfCalibrationSettings)
    """Additional parameters of the cameras."""
    datum: Literal["observations", "free_network"] = "observations"
    """What fixes the datum of the block. `observations`: a datum defect is an error. `free_network`: the
    undetermined part (of three shifts, three rotations, scale) is fixed by inner constraints on approximate
    values; for blocks without GNSS and control, and for blocks with height control only.
    """
    inner_constraints: Literal["object_points", "projection_centres", "both"] = "object_points"
    """The unknowns of a free network whose corrections to their approximate values have minimum norm:
    `object_points` (from intersection with the exposures as given), `projection_centres` (as given) or
    `both`. The standard deviations refer to this datum.
    """
    residual_grid: ResidualGridSettings = Field(default_factory=ResidualGridSettings)
    """Mean residuals in sub-areas of the image, and corrections derived from them."""
    refraction: Literal["standard", "none"] = "standard"
    """Atmospheric refraction of the image rays: `standard` (ICAO atmosphere) or `none`, for image points that
    are already corrected. The effect is 1 to 4 µm in the corner of a large format.
    """
    rejection: Rejection = Field(default_factory=Rejection)
    """Rejection of gross errors."""
    sigma0: Literal["a_posteriori", "a_priori"] = "a_posteriori"
    """The σ0 that scales the standard deviations: `a_posteriori` (from the residuals) or `a_priori` (1: the
    stated σ of the observations are taken as known).
    """
    variance_components: bool = False
    """Whether the σ of the groups are estimated from the residuals: one factor each for image points, control
    in plan and in height, GNSS in plan and in height, INS roll and pitch, INS yaw, and the priors of each
    kind of parameter. Parts with a redundancy below 10 keep their stated σ. Unmodelled systematic errors
    increase these factors.
    """
    variance_components_by: tuple[VarianceDivision, ...] = ()
    """Divisions of the groups for the estimation of variance components: image points by `file` (for manual
    and automatic measurements delivered separately) and by `camera`; GNSS and INS by `flight`. Used only
    where variance components are estimated.
    """
    control_folds: Annotated[Whole, Field(ge=2)] | None = None
    """Number of folds into which the control points are divided, each over the whole area. The points of a
    fold are predicted by the adjustment without this fold (`k_fold` in summary.json). Leaving out one point
    at a time is always computed. Neither requires another adjustment.
    """
    gnss_correlation_s: Positive | None = None
    """Correlation time τ of the errors of GNSS positions, s: the errors of two exposures of a strip at an
    interval Δt are correlated by exp(−Δt/τ) (first-order Gauss–Markov). Default: independent errors. If they
    are in fact correlated, the σ of shifts, lever arm and principal point come out too small. Requires strips
    and times.
    """
    ins_correlation_s: Positive | None = None
    """The same for roll, pitch and yaw of INS attitudes, s; important for the boresight."""
    estimate_correlation: bool = False
    """Whether the stated correlation times are only initial values and are estimated from the residuals. Best
    combined with `variance_components = true`, because wrong σ and wrong correlation times have similar
    effects.
    """
    own_observations: tuple[OwnObservationsInput, ...] = ()
    """Files with observations of types that other installed packages add, as tables
    `[[adjustment.own_observations]]`.
    """
    max_iterations: Annotated[Whole, Field(ge=1)] = 20
    """Number of iterations after which the adjustment is regarded as divergent; with good approximate values,
    2 to 5 are needed.
    """
    confidence: Annotated[Real, Field(gt=0.5, lt=1.0)] = 0.95
    """Confidence level of tests and of statements about significance."""
    priors: Priors = Field(default_factory=Priors)
    """Standard deviations of the initial values of estimated parameters."""

    @property
    def correlation_times_s(self) -> dict[str, float | None]:
        """Stated correlation times of the groups that can have one, s."""
        return {"gnss_positions": self.gnss_correlation_s, "ins_attitudes": self.ins_correlation_s}

    @model_validator(mode="after")
    def _free_only_once(self) -> AdjustmentSettings:
        if len(set(self.free)) != len(self.free):
            raise trouble("A parameter is named twice in `free`.", "Name each of them once.")
        return self

    @model_validator(mode="after")
    def _correlation_has_a_start(self) -> AdjustmentSettings:
        if self.estimate_correlation and self.gnss_correlation_s is None and self.ins_correlation_s is None:
            raise trouble(
                "`estimate_correlation` has no correlation time to start from.",
                "Give `gnss_correlation_s`, `ins_correlation_s` or both; some exposure intervals are a good "
                "start.",
            )
        return self
