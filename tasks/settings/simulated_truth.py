"""Settings of a simulation: noise, gross errors and the true values that the measurements are made from."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from tasks.plain_text import quoted
from tasks.settings.adjustment import Selection
from tasks.settings.base import Settings, trouble
from tasks.settings.coordinates import (
    Finite,
    NotNegative,
    NotNegativeTriple,
    Positive,
    PositiveTriple,
    Real,
    Triple,
    Whole,
    one_or_two,
)

#: What a simulation may ask for at most.
MOST_EXPOSURES, MOST_SURVEYED = 200_000, 10_000


def _without_quotes(name: str) -> str:
    if name != name.strip() or set(name) & set(',"'):
        raise trouble(
            f"The tables of a simulation cannot contain the name {quoted(name)}: it has a comma, a quotation "
            "mark, or a blank at its beginning or end.",
            "Give a name without them.",
        )
    return name


#: A name in the tables that are written.
WrittenName: TypeAlias = Annotated[str, Field(min_length=1), AfterValidator(_without_quotes)]
Part: TypeAlias = Annotated[Real, Field(ge=0.0, lt=1.0)]
Pair: TypeAlias = tuple[Finite, Finite]
SilentSource: TypeAlias = Literal["image", "control", "gnss", "gnss_markov", "ins", "ins_markov"]


class SimulatedGrossErrors(Settings):
    """Gross errors; all of them are listed in truth/gross_errors.parquet."""

    image_rate: Part = 0.0
    """Fraction of wrong image points."""
    image_um: Annotated[tuple[Positive, Positive], BeforeValidator(one_or_two)] = (20.0, 200.0)
    """Minimum and maximum size of these errors, µm."""
    control_swaps: Annotated[Whole, Field(ge=0, le=MOST_SURVEYED)] = 0
    """Number of pairs of control points whose coordinates are exchanged."""
    wrong_time_strips: Annotated[Whole, Field(ge=0, le=MOST_EXPOSURES)] = 0
    """Number of strips whose positions have a wrong time."""
    time_error_s: Finite = 1.0
    """Size of this time error, s."""

    @model_validator(mode="after")
    def _ascending(self) -> SimulatedGrossErrors:
        smallest, largest = self.image_um
        if smallest > largest:
            raise trouble(
                f"The minimum of image_um is {smallest:g} µm, and its maximum {largest:g} µm.",
                "Give the minimum first.",
            )
        return self


class SimulatedNoise(Settings):
    """Noise; the project states these standard deviations."""

    image_um: Positive
    """σ of image coordinates, µm."""
    control_m: PositiveTriple = (0.02, 0.02, 0.02)
    """σ of surveyed points, m."""
    gnss_m: NotNegativeTriple = (0.05, 0.05, 0.05)
    """σ of positions, white, m."""
    ins_deg: NotNegativeTriple = (0.003, 0.003, 0.008)
    """σ of roll, pitch, heading, white, degrees."""
    gnss_markov_m: NotNegativeTriple = (0.0, 0.0, 0.0)
    """σ of the part of the positions' noise that is correlated over time within a strip (first-order
    Gauss–Markov), m. The project states the σ of both parts together; if `gnss_m` is 0, it also states the
    correlation time. Otherwise the project takes all of it as white, and the σ of its results are too small.
    """
    gnss_correlation_s: Positive = 100.0
    """Its correlation time, s."""
    ins_markov_deg: NotNegativeTriple = (0.0, 0.0, 0.0)
    """The same for roll, pitch, heading, degrees; stated likewise if `ins_deg` is 0."""
    ins_correlation_s: Positive = 100.0
    """Its correlation time, s."""
    level: NotNegative = 1.0
    """Factor applied to all noise; 0: free of noise, stated σ unchanged."""
    silent: tuple[SilentSource, ...] = ()
    """Sources whose noise is omitted, e.g. `["gnss", "ins"]`."""
    gross_errors: SimulatedGrossErrors = Field(default_factory=SimulatedGrossErrors)
    """Gross errors."""

    @model_validator(mode="after")
    def _some_noise(self) -> SimulatedNoise:
        for white, markov, name in (
            (self.gnss_m, self.gnss_markov_m, "gnss"),
            (self.ins_deg, self.ins_markov_deg, "ins"),
        ):
            if not all(one > 0.0 or other > 0.0 for one, other in zip(white, markov, strict=True)):
                raise trouble(
                    f"The σ of a component of `{name}` is zero, white and correlated.",
                    "Give one of the two; `level = 0` leaves the noise out and keeps the stated σ.",
                )
        return self


class SimulatedImageErrors(Settings):
    """Systematic image errors."""

    radial_um: Finite = 0.0
    """Radial error in the corner of the format, µm."""
    tile_um: NotNegative = 0.0
    """RMS of the shifts of the eight outer tiles of 3 × 3, µm."""
    corner_um: NotNegative = 0.0
    """RMS of the displacements of the corners, µm."""
    seams_mm: tuple[Positive, Positive] | None = None
    """Seams from the centre along image x, y, mm; default: equal thirds."""
    additional_um: dict[Selection, Finite] = Field(default={})
    """Errors of the form of additional parameters, e.g. `{ "bluh:10" = 0.8 }`: the largest error of each in
    the format, µm; a negative number reverses the sign.
    """


class PublishedCheck(Settings):
    """Published results for the simulated flight, shown with those of the simulation."""

    rmse_m: PositiveTriple | None = None
    """RMS at check points by direct georeferencing, east, north, up, m."""
    y_parallax_max_um: Positive | None = None
    """Largest y-parallax, µm."""
    remark: str = ""
    """A sentence with information needed for the comparison."""


class SimulatedTruth(Settings):
    """True camera system; the project states zero, and the certified interior orientation."""

    source: str | None = None
    """Source of these values, as a text shown with the estimates."""
    published: PublishedCheck | None = None
    """Published results of a check with these values."""

    focal_length_change_mm: Finite = 0.0
    """True minus certified c, mm."""
    principal_point_change_mm: Pair = (0.0, 0.0)
    """True minus certified principal point x, y, mm."""
    boresight_deg: Triple = (0.0, 0.0, 0.0)
    """Boresight roll, pitch, yaw, degrees."""
    lever_arm_m: Triple = (0.0, 0.0, 0.0)
    """Lever arm, body axes (forward, right, down), m."""
    gnss_shift_m: Triple = (0.0, 0.0, 0.0)
    """GNSS shift of every flight, m."""
    gnss_shift_of_flight_m: dict[str, Triple] = Field(default_factory=dict)
    """GNSS shift of single flights instead; keys are flight names."""
    strip_bias_m: NotNegativeTriple = (0.0, 0.0, 0.0)
    """σ of the random GNSS bias of a strip, m."""
    strip_drift_m_s: NotNegativeTriple = (0.0, 0.0, 0.0)
    """σ of the random GNSS drift of a strip, m/s."""
    ins_strip_bias_deg: NotNegativeTriple = (0.0, 0.0, 0.0)
    """σ of the random INS bias of a strip, roll, pitch, yaw, degrees."""
    ins_drift_deg_s: NotNegativeTriple = (0.0, 0.0, 0.0)
    """σ of the random INS drift of a strip, roll, pitch, yaw, degrees per second."""
    time_offset_s: Finite = 0.0
    """Positions refer to times later than the exposures by this, s."""
    refraction: bool = False
    """Whether the image rays are refracted."""
    image_errors: SimulatedImageErrors = Field(default_factory=SimulatedImageErrors)
    """Systematic image errors."""
