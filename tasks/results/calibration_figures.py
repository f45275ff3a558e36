"""Figures of a calibration: verdicts, releases, one step against two, the strips of two steps."""

from __future__ import annotations

from collections.abc import Mapping

from tasks.results.figure import Figure, Values


class CalibrationVerdictFigure(Figure):
    """The result of a flight for one parameter; numbers in the unit of parameters.parquet."""

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
