"""Settings that declare the meaning of coordinates and angles of an input.

None of these has a default: a wrong guess here is metres in the result, and nothing else would tell.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from tasks.magnitude import LARGEST, SMALLEST
from tasks.settings.base import InputPath, Settings, trouble


def _of_a_size(value: float) -> float:
    if abs(value) > LARGEST:
        raise trouble(
            f"The value {value:g} is more than {LARGEST:g}, which is impossible for a quantity.",
            "Correct it.",
        )
    return value


def _zero_or_of_a_size(value: float) -> float:
    if 0.0 < value < SMALLEST:
        raise trouble(
            f"The value {value:g} is less than {SMALLEST:g}, which is impossible for a quantity.",
            "Correct it.",
        )
    return _of_a_size(value)


#: A number, and no text that looks like one.
Real: TypeAlias = Annotated[float, Field(strict=True)]
Whole: TypeAlias = Annotated[int, Field(strict=True)]
_OfASize = AfterValidator(_zero_or_of_a_size)
Finite: TypeAlias = Annotated[Real, Field(allow_inf_nan=False), AfterValidator(_of_a_size)]
Positive: TypeAlias = Annotated[Real, Field(gt=0.0, allow_inf_nan=False), _OfASize]
NotNegative: TypeAlias = Annotated[Real, Field(ge=0.0, allow_inf_nan=False), _OfASize]
NotNegativePair: TypeAlias = tuple[NotNegative, NotNegative]

#: The name of a project or input whose coordinates are metric Cartesian without any earth.
LOCAL = "local"


class LinearAlteration(Settings):
    """IGN's "linear alteration" of altitudes: the height above ground is multiplied by the map scale.

    Altitude in the file = Zg + k (H − Zg) with the point scale k of the projection, the ground height Zg
    and the true altitude H.
    """

    ground_m: Finite
    """Ground height Zg in the height system of the input, m."""


class Heights(Settings):
    """Height system: ellipsoidal, or altitudes above a geoid given as a grid."""

    geoid: InputPath | None = None
    """GeoTIFF with the undulation N of the geoid above the ellipsoid (h = H + N), as PROJ publishes them.
    Written as `heights = { geoid = "FILE.tif" }`; `heights = "ellipsoidal"` otherwise. The grid must be
    named: an undulation is never assumed to be zero.
    """
    linear_alteration: LinearAlteration | None = None
    """Undo IGN's linear alteration of the flying height (exposures in Lambert-93); next to `geoid`:
    `linear_alteration = { ground_m = 205.0 }`. An error of 100 m in `ground_m` causes about 7 cm.
    """

    @model_validator(mode="before")
    @classmethod
    def _from_text(cls, value: object) -> object:
        if value == "ellipsoidal":
            return {}
        if isinstance(value, dict) and set(value) == {"linear_alteration"}:
            raise trouble(
                "The linear alteration applies to altitudes above a geoid.",
                "Also give the geoid grid, or remove linear_alteration.",
            )
        if isinstance(value, Heights) or (isinstance(value, dict) and value):
            return value
        raise trouble("The height system is not valid.", 'Write "ellipsoidal" or { geoid = "FILE.tif" }.')


class PlacedSettings(Settings):
    """Base of settings with a `crs` and `heights`: local coordinates have one height, and need no system."""

    @model_validator(mode="before")
    @classmethod
    def _local_heights(cls, value: object) -> object:
        if isinstance(value, dict) and value.get("crs") == LOCAL:
            return {"heights": "ellipsoidal", **value}
        return value


class Angles(Settings):
    """Definition of the angles in an exposure input."""

    order: Literal["omega-phi-kappa", "phi-omega-kappa", "heading-pitch-roll"]
    """`omega-phi-kappa`: R = R_x(ω) R_y(φ) R_z(κ); `phi-omega-kappa`: R = R_y(φ) R_x(ω) R_z(κ), both ground
    from camera; `heading-pitch-roll`: the inertial unit's body (ARINC 705).
    """
    unit: Literal["deg", "gon", "rad"]
    """Unit of the angles and of their standard deviations in the file."""
    reference: Literal["grid", "true-north", "local"]
    """Reference of the angles. `grid`: the axes of the input's map projection (the meridian convergence is
    applied exactly); `true-north` and `local`: east, north, up at each exposure. With crs = "local", the axes
    of the project itself.
    """
    rate_axes: Literal["forward-right-down", "forward-left-up"] | None = None
    """Body axes of the angular velocities in the columns rate_roll, rate_pitch, rate_yaw, in `unit` per
    second, as written by a trajectory processor (SBET: `forward-right-down`). With rates, a time offset also
    affects the attitudes.
    """


#: Heights above the ellipsoid.
ELLIPSOIDAL = Heights(geoid=None)


def one_or_three(value: object) -> object:
    """One number stands for three equal ones."""
    return (value, value, value) if isinstance(value, int | float) else value


def one_or_two(value: object) -> object:
    """One number stands for two equal ones."""
    return (value, value) if isinstance(value, int | float) else value


def one_table_or_several(value: object) -> object:
    """A single table stands for an array with one table."""
    return (value,) if isinstance(value, dict | Settings) else value


PositiveTriple: TypeAlias = Annotated[tuple[Positive, Positive, Positive], BeforeValidator(one_or_three)]
NotNegativeTriple: TypeAlias = Annotated[
    tuple[NotNegative, NotNegative, NotNegative], BeforeValidator(one_or_three)
]
PositivePair: TypeAlias = Annotated[tuple[Positive, Positive], BeforeValidator(one_or_two)]
Triple: TypeAlias = tuple[Finite, Finite, Finite]
