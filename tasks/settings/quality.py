"""Settings of quality: suspicions raised before the adjustment, and gates after it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from tasks.settings.base import Settings, trouble
from tasks.settings.coordinates import Finite, Positive, PositiveTriple

#: Image points outside the format are left out up to this part of a file: mismatches, not another camera.
OUTSIDE_FORMAT_SHARE = 0.001
#: The gates whose figures a trust map gives.
TRUST_MAP_GATES = ("trust_map_plan_m", "trust_map_height_m", "trust_map_external_m")


class ChecksSettings(Settings):
    """Limits of the plausibility checks before the adjustment."""

    outside_format_share: Annotated[float, Field(ge=0.0, lt=1.0)] = OUTSIDE_FORMAT_SHARE
    """Fraction of the image points of a file that may lie outside the format of their image. They are
    excluded and reported; more are an error, 0 allows none. Default 0.001: with a wrong unit, camera or pixel
    size, far more points lie outside.
    """

    min_intersection_angle_deg: Positive = 1.0
    """Minimum intersection angle of the rays of an object point, degrees; points below it are not used,
    because their distance is not determined.
    """
    tie_residual_px: Positive = 50.0
    """Median residual of tie points with the given orientations, px, above which the orientations, their
    angle convention or the mounting are refused as wrong. The limit is never below ten times what the stated
    σ of the exposures explain.
    """
    control_distance_m: Positive = 50.0
    """Distance between a control point and its intersection from the given orientations, m, above which the
    point is refused as wrong (a few check points are reported). The limit is never below ten times what the
    stated σ of the exposures explain.
    """


class Gate(Settings):
    """Limits of one figure; only the given limits are tested."""

    min: Finite | None = None
    """Smallest value that passes."""
    max: Positive | None = None
    """Largest value that passes."""

    @model_validator(mode="after")
    def _can_be_passed(self) -> Gate:
        if self.min is not None and self.max is not None and self.min > self.max:
            raise trouble(
                f"No value passes a gate whose min {self.min:g} is more than its max {self.max:g}.",
                "Exchange the two, or correct one of them.",
            )
        return self


class AxisGate(Settings):
    """Limit of a figure with three components x, y, z, in metres."""

    max: PositiveTriple
    """Largest values that pass, m; one number or three."""


class Gates(Settings):
    """Limits that a result must meet; a missing gate is not tested, a failed one ends with exit code 4."""

    sigma0: Gate | None = None
    """σ0 a posteriori / a priori, e.g. `{ max = 1.2 }`; small values are suspicious too."""
    rmse_control_m: AxisGate | None = None
    """RMS of the control residuals."""
    max_control_m: AxisGate | None = None
    """Largest control residual, x, y and z separately."""
    rmse_check_m: AxisGate | None = None
    """RMS of the check points."""
    max_check_m: AxisGate | None = None
    """Largest difference at a check point."""
    check_over_limit: Gate | None = None
    """RMS and mean at check points divided by their limits expected from the σ (`adjustment.confidence`), the
    largest ratio of all. With `{ max = 1.0 }`, none may exceed its limit.
    """
    registered_calibration: Gate | None = None
    """Probability of the test T whether the block contradicts a calibration of the registry; that of the
    worst camera. E.g. `{ min = 0.001 }`.
    """
    direct_georeferencing_rmse_m: AxisGate | None = None
    """RMS of the differences at independent check points in direct georeferencing."""
    direct_georeferencing_max_m: AxisGate | None = None
    """Largest of these differences."""
    y_parallax_rms_um: Gate | None = None
    """RMS of the y-parallaxes of all stereo models, µm, e.g. `{ max = 8.0 }`."""
    y_parallax_max_um: Gate | None = None
    """Largest of these y-parallaxes, µm."""
    trust_map_plan_m: Gate | None = None
    """The larger σ of east and north of a new point, m, that `trust_map.share` of the area does not exceed,
    e.g. `{ max = 0.03 }`.
    """
    trust_map_height_m: Gate | None = None
    """The same of the σ of the height; with `{ max = 0.05 }`, 95 % of the area must be better than 5 cm."""
    trust_map_external_m: Gate | None = None
    """The same of the largest coordinate error that an undetected gross error can cause; areas in which it is
    unlimited count as failed.
    """

    @model_validator(mode="after")
    def _not_empty(self) -> Gates:
        for name in type(self).model_fields:
            gate = getattr(self, name)
            if isinstance(gate, Gate) and gate.min is None and gate.max is None:
                raise trouble(f"The gate {name} has no limit.", "Give `max`, `min` or both.")
        return self
