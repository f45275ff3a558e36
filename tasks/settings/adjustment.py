"""Settings of the adjustment: what is free, how gross errors are rejected, how precision is stated."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator

from tasks.settings.base import Settings, trouble
from tasks.settings.coordinates import Positive, PositivePair, PositiveTriple

FreeParameter: TypeAlias = Literal[
    "boresight",
    "lever_arm",
    "gnss_shift",
    "gnss_strip_bias",
    "gnss_drift",
    "time_offset",
    "focal_length",
    "principal_point",
]
ObservedGroup: TypeAlias = Literal["gnss", "ins", "control"]


class Rejection(Settings):
    """Rejection of gross errors."""

    critical_value: Annotated[float, Field(gt=1.0, allow_inf_nan=False)] | None = Field(
        default=4.13,
        description="Observations whose standardized residual exceeds it are rejected. Written as "
        '`rejection = { critical_value = 4.13 }`, or `rejection = "none"`. Default 4.13: one false alarm '
        "in 20 "
        "blocks of 1,500 observations; 3.29 means one in 1,000 observations. Too small a value makes the "
        "results look better than they are.",
    )
    test: Literal["components", "observations"] = Field(
        default="components",
        description="What is compared with it: `components` (the largest standardized residual of an "
        "observation) or `observations` (both coordinates of an image point, all three of a control point "
        "together, by the value of a normal variable that is exceeded as rarely). With `observations` the "
        "false alarms are as many as the critical value says; with `components` up to twice or three times "
        "as many.",
    )
    reference_variance: Literal["a_priori", "a_posteriori"] = Field(
        default="a_priori",
        description="The σ0 of the tests: `a_priori` (1) or `a_posteriori` (from the residuals; the τ-test), "
        "for deliveries whose σ are not to be trusted.",
    )
    robust: Literal["huber", "cauchy", "tukey", "biber", "danish"] | None = Field(
        default=None,
        description="Weight function of a robust estimation that looks for gross errors before the tests; "
        "for blocks in which very many observations are wrong. It only finds; nothing is weighted down "
        "in the results.",
    )

    @model_validator(mode="before")
    @classmethod
    def _from_text(cls, value: object) -> object:
        if value == "none":
            return {"critical_value": None}
        if isinstance(value, dict | Rejection):
            return value
        raise trouble("The rejection is not understood.", 'Write "none" or { critical_value = 4.13 }.')


class Priors(Settings):
    """Standard deviations of directly observed parameters; a parameter without one is free of it."""

    boresight_deg: PositiveTriple | None = Field(
        default=None,
        description="Boresight roll, pitch, yaw about its initial value, degrees; one number or three.",
    )
    lever_arm_m: PositiveTriple | None = Field(
        default=None, description="Lever arm about its initial value (body axes), m; one number or three."
    )
    gnss_shift_m: PositiveTriple | None = Field(
        default=None, description="GNSS shift of a flight about zero, m; one number or three."
    )
    gnss_strip_bias_m: PositiveTriple = Field(
        default=(0.03, 0.03, 0.03),
        description="GNSS bias of a strip about the shift of its flight, m; one number or three. Default "
        "0.03 m: what GNSS errors that change slowly leave in a strip.",
    )
    gnss_drift_m_s: PositiveTriple | None = Field(
        default=None, description="GNSS drift of a strip about zero, m/s; one number or three."
    )
    time_offset_s: Positive | None = Field(
        default=None, description="Time offset between exposures and trajectory about zero, s."
    )
    focal_length_mm: Positive | None = Field(
        default=None, description="Focal length about the camera's value, mm."
    )
    principal_point_mm: PositivePair | None = Field(
        default=None, description="Principal point x, y about the camera's value, mm; one number or two."
    )


class AdjustmentSettings(Settings):
    """The bundle adjustment."""

    free: tuple[FreeParameter, ...] = Field(
        default=(),
        description='System parameters to estimate, e.g. `["boresight", "lever_arm"]`; everything else '
        "stays at its "
        "given value.",
    )
    observe: tuple[ObservedGroup, ...] = Field(
        default=("gnss", "ins", "control"),
        description="Observations besides the image points that enter the adjustment. Without `gnss` or "
        "`ins` the exposures still give approximate values; without `control` the control points become "
        "check points.",
    )
    refraction: Literal["standard", "none"] = Field(
        default="standard",
        description="Atmospheric refraction of the image rays: `standard` (ICAO atmosphere) or `none`, for "
        "image points it has been taken from already. 1 to 4 µm in the corner of a large format.",
    )
    rejection: Rejection = Field(default_factory=Rejection, description="Rejection of gross errors.")
    sigma0: Literal["a_posteriori", "a_priori"] = Field(
        default="a_posteriori",
        description="The σ0 that scales the standard deviations: `a_posteriori` (from the residuals) or "
        "`a_priori` (1: "
        "the stated σ of the observations are trusted).",
    )
    variance_components: bool = Field(
        default=False,
        description="Whether the σ of the groups are estimated from the residuals: one factor each for image "
        "points, control in plan and in height, GNSS in plan and in height, INS roll and pitch, INS yaw, and "
        "the priors of each kind of parameter; what has a redundancy below 10 keeps its stated σ. Systematic "
        "errors that are not modelled end up in these factors.",
    )
    max_iterations: Annotated[int, Field(ge=1)] = Field(
        default=20,
        description="Iterations after which the adjustment counts as divergent; good starts need 2 to 5.",
    )
    confidence: Annotated[float, Field(gt=0.5, lt=1.0)] = Field(
        default=0.95, description="Confidence level of tests and of statements about significance."
    )
    priors: Priors = Field(
        default_factory=Priors, description="Standard deviations of the initial values of free parameters."
    )

    @model_validator(mode="after")
    def _free_only_once(self) -> AdjustmentSettings:
        if len(set(self.free)) != len(self.free):
            raise trouble("A parameter is named twice in `free`.", "Name each of them once.")
        return self
