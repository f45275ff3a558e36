"""Settings of quality: suspicions raised before the adjustment, and gates after it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from tasks.settings.base import Settings, trouble
from tasks.settings.coordinates import Finite, Positive, PositiveTriple

#: Image points outside the format are left out up to this part of a file: mismatches, not another camera.
OUTSIDE_FORMAT_SHARE = 0.001


class ChecksSettings(Settings):
    """When something looks wrong before the adjustment."""

    outside_format_share: Annotated[float, Field(ge=0.0, lt=1.0)] = Field(
        default=OUTSIDE_FORMAT_SHARE,
        description="Part of the image points of a file that may lie outside the format of their image: they "
        "are left out, and that is said. More are an error, 0 allows none. Default 0.001: a wrong unit, "
        "camera or pixel size puts far more outside.",
    )

    min_intersection_angle_deg: Positive = Field(
        default=1.0,
        description="Object points whose rays meet under a smaller angle are not used: their distance is "
        "not determined, degrees.",
    )
    tie_residual_px: Positive = Field(
        default=50.0,
        description="Median residual of tie points with the given orientations above which the "
        "orientations, their angle convention or the mounting are called wrong, px.",
    )
    control_distance_m: Positive = Field(
        default=50.0,
        description="Distance between a control point and its intersection from the given orientations "
        "above which the point is called wrong, m.",
    )


class Gate(Settings):
    """Limits of one figure; a limit that is not given is not tested."""

    min: Finite | None = Field(default=None, description="Smallest value that passes.")
    max: Positive | None = Field(default=None, description="Largest value that passes.")


class AxisGate(Settings):
    """Limit of a figure with three components x, y, z, in metres."""

    max: PositiveTriple = Field(description="Largest values that pass, m; one number or three.")


class Gates(Settings):
    """What a result must keep; a missing gate is not tested, a failed one ends with exit code 4."""

    sigma0: Gate | None = Field(
        default=None,
        description="σ0 a posteriori / a priori, e.g. `{ max = 1.2 }`; small values are suspicious too.",
    )
    rmse_control_m: AxisGate | None = Field(default=None, description="RMS of the control residuals.")
    rmse_check_m: AxisGate | None = Field(default=None, description="RMS of the check points.")
    max_check_m: AxisGate | None = Field(default=None, description="Largest difference at a check point.")
    check_over_limit: Gate | None = Field(
        default=None,
        description="RMS and mean at check points over the limits that their σ let expect "
        "(`adjustment.confidence`), the largest of all: `{ max = 1.0 }` lets none of them miss its limit.",
    )
    registered_calibration: Gate | None = Field(
        default=None,
        description="How often chance alone exceeds the test T whether the block contradicts a calibration "
        "of the registry; the worst camera counts. E.g. `{ min = 0.001 }`.",
    )
    direct_georeferencing_rmse_m: AxisGate | None = Field(
        default=None,
        description="RMS of the differences at independent check points, georeferenced directly.",
    )
    direct_georeferencing_max_m: AxisGate | None = Field(
        default=None, description="Largest of these differences."
    )
    y_parallax_rms_um: Gate | None = Field(
        default=None, description="RMS of the y-parallaxes of all stereo models, µm, e.g. `{ max = 8.0 }`."
    )
    y_parallax_max_um: Gate | None = Field(default=None, description="Largest of these y-parallaxes, µm.")

    @model_validator(mode="after")
    def _not_empty(self) -> Gates:
        for name in type(self).model_fields:
            gate = getattr(self, name)
            if isinstance(gate, Gate) and gate.min is None and gate.max is None:
                raise trouble(f"The gate {name} has no limit.", "Give `max`, `min` or both.")
        return self
