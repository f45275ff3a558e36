"""Settings of the movement of images during exposure, with which their edges are compared."""

from __future__ import annotations

from pydantic import model_validator

from tasks.settings.base import Settings, trouble
from tasks.settings.coordinates import NotNegative, Positive


class MotionSettings(Settings):
    """Exposure time and compensation; rates and velocities are those of the exposures of the project."""

    exposure_ms: Positive
    """Exposure time of the images, ms."""
    sigma_exposure_ms: NotNegative = 0.0
    """Its standard deviation, ms."""
    forward_motion: bool
    """Whether the images hold the movement of the flight: `false` for a camera that compensates it (time
    delay integration, moved sensor).
    """
    height_above_ground_m: Positive | None = None
    """Mean height above the ground, m; needed where the forward motion is seen."""
    sigma_rate_deg_s: Positive = 0.01
    """Standard deviation of the angular velocities of the exposures, °/s."""

    @model_validator(mode="after")
    def _height_for_forward_motion(self) -> MotionSettings:
        if self.forward_motion and self.height_above_ground_m is None:
            raise trouble(
                "The forward motion is seen, and the height above the ground is not given.",
                "Give height_above_ground_m.",
            )
        return self
