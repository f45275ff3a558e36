"""Published standards of positional accuracy: their thresholds and wording, one file for each edition."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

from pydantic import BaseModel, ConfigDict

#: Beside this module, so that they count as its source.
_EDITIONS = Path(__file__).parent / "templates"


class Standard(BaseModel):
    """What all standards have.

    Attributes
    ----------
    name, edition : as they are quoted.
    source : where thresholds and wording were taken from.
    verified : what of them was compared with the text of the standard.
    least_check_points : independent check points without which nothing is stated.
    statements : sentences with places for the figures, by the case they are for.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    edition: str
    source: str
    verified: str
    least_check_points: int
    statements: dict[str, str]


class AsprsStandard(Standard):
    """ASPRS Positional Accuracy Standards from edition 2 on.

    Attributes
    ----------
    most_check_points_needed : however large the area is.
    """

    most_check_points_needed: int


class NssdaStandard(Standard):
    """National Standard for Spatial Data Accuracy.

    Attributes
    ----------
    horizontal_factor, vertical_factor : from RMSE to the 95 % figure.
    least_ratio : of the smaller to the larger horizontal RMSE.
    """

    horizontal_factor: float
    vertical_factor: float
    least_ratio: float


@cache
def asprs() -> AsprsStandard:
    """The edition of the ASPRS standards in use."""
    return AsprsStandard.model_validate(_edition("asprs_edition_2"))


@cache
def nssda() -> NssdaStandard:
    """The edition of the NSSDA in use."""
    return NssdaStandard.model_validate(_edition("nssda_1998"))


def _edition(name: str) -> dict[str, object]:
    return tomllib.loads((_EDITIONS / f"{name}.toml").read_text(encoding="utf-8"))
