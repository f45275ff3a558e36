"""Settings of the direct-georeferencing check: which calibration, and what is known of its errors."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationInfo, model_validator
from pydantic_core import PydanticCustomError

from tasks.settings.base import InputPath, PathContext, Settings, trouble
from tasks.settings.coordinates import NotNegativeTriple, Positive, PositivePair

CAMERAS, ADJUSTMENT, REGISTRY = "cameras", "adjustment", "registry"
_WRITE = 'Write one text: "cameras", "adjustment", "registry", or a folder of results.'
_TABLES = ("parameters", "correlations", "control_residuals", "control_points", "cameras")
# What results of older versions do not have: without it no flight is taken for that of the calibration.
_OF_FLIGHT = ("parameter_influences", "exposures")


def _is_there(path: str, info: ValidationInfo) -> bool:
    context = info.context if isinstance(info.context, PathContext) else PathContext(Path.cwd())
    try:
        context.resolve(path)
    except PydanticCustomError:
        return False
    return True


class CalibrationInput(Settings):
    """The calibration that is checked.

    Written as one text: `"cameras"`, `"adjustment"`, `"registry"`, or a folder of results.
    """

    adjustment: bool = False
    """`calibration = "adjustment"`: the values estimated by this project's own adjustment; its control points
    are then calibration control.
    """
    registry: bool = False
    """`calibration = "registry"`: for each camera the approved calibration of the registry that is valid on
    `project.flown`.
    """
    parameters: InputPath | None = None
    """Its system parameters with their σ; `calibration = "FOLDER"` is short for the five files of these names
    in a result folder.
    """
    correlations: InputPath | None = None
    """Their correlations."""
    control_residuals: InputPath | None = None
    """Names of the points used as control in the calibration."""
    control_points: InputPath | None = None
    """Coordinates of these points."""
    cameras: InputPath | None = None
    """The calibrated cameras: body, lens, product, image and mounting must be those of the project's camera
    of the same name.
    """
    parameter_influences: InputPath | None = None
    """Derivatives of its parameters with respect to the observations they were estimated from; taken from the
    folder if present.
    """
    exposures: InputPath | None = None
    """The exposures used in the calibration: if this project has the same ones, the calibration contains
    their errors. Taken from the folder if present.
    """

    @model_validator(mode="before")
    @classmethod
    def _from_text(cls, value: object, info: ValidationInfo) -> object:
        if isinstance(value, str) and value.strip():
            if value in (CAMERAS, ADJUSTMENT, REGISTRY):
                return {name: value == name for name in (ADJUSTMENT, REGISTRY)}
            files = {name: f"{value}/{name}.parquet" for name in (*_TABLES, *_OF_FLIGHT)}
            of_flight = all(_is_there(files[name], info) for name in _OF_FLIGHT)
            return {name: files[name] for name in (*_TABLES, *(_OF_FLIGHT if of_flight else ()))}
        if isinstance(value, dict | CalibrationInput):
            return value
        raise trouble("The calibration is not valid.", _WRITE)

    @model_validator(mode="after")
    def _complete(self) -> CalibrationInput:
        given = [name for name in _TABLES if getattr(self, name) is not None]
        ways = int(self.adjustment) + int(self.registry) + bool(given)
        of_flight = [name for name in _OF_FLIGHT if getattr(self, name) is not None]
        partly = len(given) % len(_TABLES) or len(of_flight) % len(_OF_FLIGHT) or (of_flight and not given)
        if ways > 1 or partly:
            raise trouble("The calibration is specified by only some of its files, or twice.", _WRITE)
        return self

    @property
    def is_of_results(self) -> bool:
        """Whether it is in the results of another run."""
        return self.parameters is not None


class DirectGeoreferencingSettings(Settings):
    """The direct-georeferencing check."""

    calibration: CalibrationInput = CalibrationInput()
    """The calibration to be checked: `"cameras"` (the values of this file's cameras, assumed to be free of
    error), `"adjustment"` (those estimated by this project's own adjustment), `"registry"` (those approved
    for `project.flown`), or the result folder of another project.
    """
    shift_of_flight: str | None = None
    """Flight of the calibration whose GNSS shift and time offset are used for the flights of this project.
    Default: the flight of the same name, or the only one.
    """
    strip_bias_m: NotNegativeTriple | None = None
    """σ of a GNSS error common to all images of a strip, east, north, up, m; one number or three. It is added
    to the σ of the exposures, as in the adjustment. Default: `adjustment.priors.gnss_strip_bias_m` if
    `gnss_strip_bias` is in `adjustment.free`, otherwise zero.
    """
    strip_bias_deg: NotNegativeTriple = (0.0, 0.0, 0.0)
    """σ of an attitude error common to all images of a strip, roll, pitch, yaw, degrees; one number or three.
    It is added to the σ of the exposures. Errors that change slowly within a strip are described by
    `adjustment.gnss_correlation_s` and `ins_correlation_s`.
    """
    critical_value: Positive = 4.13
    """Standardized residual of a y-parallax in the relative orientation of its model above which the point is
    regarded as a mismatch and excluded from the parallaxes.
    """
    accuracy_class_m: PositivePair | None = None
    """Accuracy class to be met, RMSE_H and RMSE_V, m; one number or two. The statement by the ASPRS standards
    states whether it is met.
    """
