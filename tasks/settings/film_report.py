"""Calibration report of a film camera, written out as TOML with the numbers as they are printed."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, Field, model_validator

from tasks.settings.base import Settings, trouble
from tasks.settings.coordinates import Finite, Positive

Pair: TypeAlias = tuple[Finite, Finite]
#: Micrometres in a unit of the printed distortion.
UM = {"um": 1.0, "mm": 1e3}
# Largest radial distortion of an aerial lens, and the smallest one that is worth a table, µm.
_MOST_UM, _LEAST_UM = 300.0, 0.02
# Largest coordinate of a mark, and principal distance over it, mm.
_MARKS_MM, _PRINCIPAL_DISTANCE = (20.0, 200.0), (0.4, 8.0)
# Farthest principal point from the origin, mm, and largest radius over that of the corners of the format.
_FARTHEST_MM, _BEYOND = 1.0, (0.3, 1.15)


def _direction(name: str) -> str:
    try:
        degrees = float(name)
    except ValueError:
        degrees = math.nan
    if not 0.0 <= degrees < 360.0:
        raise trouble(
            f"'{name}' is not the direction of a semi-diagonal.",
            "Write it in degrees from +x of the fiducial marks, counter-clockwise: 45, 135, 225, 315.",
        )
    return name


class ReportedCamera(Settings):
    """Camera, focal length and principal points."""

    serial: str = Field(min_length=1)
    """Serial number of the camera."""
    lens: str | None = None
    """Serial number of the lens."""
    focal_length_mm: Positive
    """Calibrated focal length, mm."""
    ppa_mm: Pair
    """Principal point of autocollimation, system of the marks, mm."""
    pps_mm: Pair
    """Point of symmetry, to which the distortion refers, likewise, mm."""
    principal_point: Literal["ppa", "pps"]
    """Which of the two is the foot of the perpendicular from the projection centre. The point of symmetry, if
    the report has determined it together with the focal length.
    """

    @model_validator(mode="after")
    def _near_the_origin(self) -> ReportedCamera:
        farthest = max(math.hypot(*self.ppa_mm), math.hypot(*self.pps_mm))
        if farthest > _FARTHEST_MM:
            raise trouble(
                f"A principal point {farthest:g} mm from the origin of the marks is that of no film camera.",
                f"Give it in mm: {farthest:g} µm are {farthest * 1e-3:g} mm.",
            )
        return self


class ReportedDistortion(Settings):
    """Radial distortion: a mean, or one value for each semi-diagonal."""

    unit: Literal["um", "mm"]
    """Unit of the distortion and its σ."""
    positive: Literal["outward", "inward"]
    """Meaning of a positive value: the image is displaced `outward`, away from the point of symmetry, or
    `inward`.
    """
    sigma: Positive
    """Standard deviation of a value; at least 0.3 of the last digit that is printed."""
    radius_mm: tuple[Positive, ...] | None = None
    """Distances from the point of symmetry, ascending, mm."""
    angle_deg: tuple[Annotated[Positive, Field(lt=80.0)], ...] | None = None
    """Field angles instead of distances, ascending, degrees."""
    mean: tuple[Finite, ...] | None = None
    """Distortion at these distances or angles, mean of all directions."""
    semi_diagonals: dict[Annotated[str, AfterValidator(_direction)], tuple[Finite, ...]] = Field(
        default_factory=dict
    )
    """Distortion along semi-diagonals instead of the mean, by their directions in degrees: `{ 45 = [0.2, …],
    135 = …, 225 = …, 315 = … }`.
    """

    @property
    def places(self) -> tuple[float, ...]:
        """Distances, mm, or angles, degrees."""
        return self.radius_mm or self.angle_deg or ()

    @property
    def columns(self) -> tuple[tuple[float, ...], ...]:
        """The mean, or the values of each semi-diagonal."""
        return tuple(self.semi_diagonals.values()) if self.mean is None else (self.mean,)

    @model_validator(mode="after")
    def _is_a_table(self) -> ReportedDistortion:
        if (self.radius_mm is None) == (self.angle_deg is None):
            raise trouble("The distortion has no places, or two kinds.", "Give radius_mm or angle_deg.")
        if (self.mean is None) == (not self.semi_diagonals):
            raise trouble("The distortion has no values, or two kinds.", "Give mean or semi_diagonals.")
        if len(self.semi_diagonals) == 1:
            raise trouble("There is one semi-diagonal only.", "Give all of them, or their mean.")
        if any(after <= before for before, after in pairwise(self.places)):
            raise trouble("Distances or angles do not ascend.", "Correct them.")
        wrong = next((column for column in self.columns if len(column) != len(self.places)), None)
        if wrong is not None:
            raise trouble(f"There are {len(self.places)} places, but {len(wrong)} values.", "Correct them.")
        return self

    @model_validator(mode="after")
    def _in_its_unit(self) -> ReportedDistortion:
        largest = max(abs(value) for column in self.columns for value in column)
        um, other = UM[self.unit] * largest, "mm" if self.unit == "um" else "um"
        if um > _MOST_UM or 0.0 < um < _LEAST_UM:
            raise trouble(
                f"In {self.unit} the largest distortion would be {um:.3g} µm, which is that of no aerial "
                f"lens; in {other} it is {UM[other] * largest:.3g} µm.",
                f'Write unit = "{other}" if this is meant.',
            )
        return self


class FilmReport(Settings):
    """Calibration report of a film camera: `calibration_report` of a camera names the file."""

    camera: ReportedCamera
    fiducials_mm: dict[str, Pair] = Field(min_length=3)
    """Calibrated coordinates of the fiducial marks, mm."""
    distortion: ReportedDistortion

    @model_validator(mode="after")
    def _in_millimetres(self) -> FilmReport:
        side = max(abs(value) for pair in self.fiducials_mm.values() for value in pair)
        if not _MARKS_MM[0] <= side <= _MARKS_MM[1]:
            raise trouble(
                f"Fiducial marks {side:g} mm from the centre are those of no film camera.",
                "Give fiducials_mm in mm.",
            )
        c = self.camera.focal_length_mm
        if not _PRINCIPAL_DISTANCE[0] <= c / side <= _PRINCIPAL_DISTANCE[1]:
            raise trouble(
                f"A focal length of {c:g} mm with marks {side:g} mm from the centre is that of no film "
                "camera.",
                "Give focal_length_mm in mm.",
            )
        farthest = self.distortion.places[-1]
        if self.distortion.angle_deg is not None:
            farthest = c * math.tan(math.radians(farthest))
        corner = math.sqrt(2.0) * side
        if not _BEYOND[0] <= farthest / corner <= _BEYOND[1]:
            raise trouble(
                f"The distortion is stated up to {farthest:.4g} mm from the centre; the corners of the "
                f"format are about {corner:.0f} mm from it.",
                "Give radius_mm in mm, angle_deg in degrees.",
            )
        return self
