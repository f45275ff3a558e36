"""Settings of a certificate: who calibrated, under which number and date, and who signs.

Nothing of this acts on a number. What is left out is a blank line on the certificate, to be filled in by
hand.
"""

from __future__ import annotations

from collections.abc import Iterable
from datetime import date
from itertools import pairwise
from typing import Annotated, TypeAlias

from pydantic import Field, StringConstraints, model_validator

from tasks.plain_text import LONGEST_NAME
from tasks.settings.base import Settings, trouble

Line: TypeAlias = Annotated[
    str, StringConstraints(strip_whitespace=True, min_length=1, max_length=LONGEST_NAME)
]


class Laboratory(Settings):
    """The calibration laboratory."""

    name: Line | None = None
    """Name of the laboratory."""
    address: tuple[Line, ...] = ()
    """Lines of its address, e.g. `["Main Street 1", "12345 Town"]`."""
    accreditation: Line | None = None
    """Accreditation or registration number, with the accreditation body."""


class Signatory(Settings):
    """A person who signs."""

    name: Line
    """Name."""
    role: Line
    """Role, e.g. "Head of the laboratory"."""


class CertificateSettings(Settings):
    """Laboratory, numbers, dates and signatories of the certificate."""

    numbers: dict[str, Line] = Field(default_factory=dict)
    """Number of the certificate of each camera, e.g. `{ "CAM-1" = "2026-017" }`; numbers must be unique."""
    calibrated: date | None = None
    """Date of the calibration, e.g. 2026-09-21; not before `project.flown`."""
    issued: date | None = None
    """Date of issue of the certificate; not before `calibrated`."""
    laboratory: Laboratory = Field(default_factory=Laboratory)
    """The laboratory."""
    signatories: tuple[Signatory, ...] = Field(default=(), max_length=4)
    """The signatories, in the order of the signatures."""

    @model_validator(mode="after")
    def _numbers_differ(self) -> CertificateSettings:
        if len(set(self.numbers.values())) != len(self.numbers):
            raise trouble(
                "Two certificates have the same number.",
                "Give every camera a different number in `numbers`.",
            )
        return self

    def trouble_with(self, cameras: Iterable[str], flown: date | None) -> tuple[str, str] | None:
        """What contradicts the rest of the project, and the remedy; None: nothing.

        Parameters
        ----------
        cameras : names of the cameras of the project.
        flown : date of the flight.
        """
        unknown = sorted(set(self.numbers) - set(cameras))
        if unknown:
            return (
                f"certificate.numbers names the camera '{unknown[0]}', which the project does not have.",
                f"Name one of: {', '.join(cameras)}.",
            )
        dates = (
            ("project.flown", flown),
            ("certificate.calibrated", self.calibrated),
            ("certificate.issued", self.issued),
        )
        known = [(name, day) for name, day in dates if day is not None]
        for (earlier, before), (later, after) in pairwise(known):
            if after < before:
                return f"{later} ({after}) lies before {earlier} ({before}).", "Correct one of the two dates."
        return None
