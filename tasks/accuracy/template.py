"""Templates of statements about accuracy: limits, required tables and wording of an authority, as data.

Those of published standards lie next to this module, a file for each edition; a department adds its own in
the same form.
"""

from __future__ import annotations

import string
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import BaseModel, Field, ValidationError, model_validator

from tasks.accuracy.check_points import QUANTITIES, Points
from tasks.errors import Location
from tasks.files.delivered_file import read_delivered
from tasks.nearest_name import did_you_mean

#: Beside this module, so that they count as its source.
_DELIVERED = Path(__file__).parent / "templates"
#: Those that are delivered.
Standard: TypeAlias = Literal["asprs-2024", "nssda-1998"]
STANDARDS: tuple[Standard, ...] = ("asprs-2024", "nssda-1998")
#: Tables that a statement may require, as they are published.
TABLES = (
    "check_points",
    "control_residuals",
    "distance_residuals",
    "exterior_orientations",
    "object_points",
    "parameters",
    "residuals",
    "self_calibration",
    "trust_map_cells",
)
#: What a text may quote besides quantities.
_PLACES = ("name", "edition", "n", "least", "class", "exceeded")
_REMEDY = "docs/statements.md describes templates."
_Metres: TypeAlias = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class _Data(BaseModel, frozen=True, extra="forbid"):
    """Base of the parts of a template: immutable, and an unknown key is an error."""


class Texts(_Data):
    """The wording of each case; with an empty text there is no sentence.

    Attributes
    ----------
    none : without points.
    too_few, too_few_met, too_few_missed : with fewer than are needed, by what became of the limits.
    undefined : where a quantity has no value.
    found, met, missed : tested, without limits, within them, beyond one.
    """

    none: str
    too_few: str
    too_few_met: str = ""
    too_few_missed: str = ""
    undefined: str = ""
    found: str
    met: str = ""
    missed: str = ""


class Part(_Data):
    """The statement about some of the points.

    Attributes
    ----------
    points : which.
    states : the quantities it is about.
    class_of : the quantity that the class of a project limits; empty: none.
    class_from : the number of the class: horizontal, vertical, or both together (the root of their squares).
    limits_m : fixed limits of quantities, metres.
    optional : whether nothing is said without points.
    texts : by case.
    """

    points: Points
    states: tuple[str, ...] = Field(min_length=1)
    class_of: str = ""
    class_from: Literal["horizontal", "vertical", "both"] = "horizontal"
    limits_m: dict[str, _Metres] = {}
    optional: bool = False
    texts: Texts


class Template(_Data):
    """A statement of an authority.

    Attributes
    ----------
    name, edition : as they are quoted.
    source : where limits and wording were taken from.
    verified : what of them was compared with the document; empty: nothing, and every statement says so.
    least_check_points : independent check points that each part needs.
    survey_at_most : largest survey error in parts of the class; None: not requested.
    unit, decimals : of the numbers in the texts.
    tables : that must be published and not be empty.
    none : the sentence where no part has points; empty: those of the parts.
    parts : one for each kind of points.
    """

    name: str = Field(min_length=1)
    edition: str = Field(min_length=1)
    source: str = ""
    verified: str = ""
    least_check_points: Annotated[int, Field(ge=1)]
    survey_at_most: _Metres | None = None
    unit: Literal["m", "cm", "mm"] = "m"
    decimals: Annotated[int, Field(ge=0, le=6)] = 3
    tables: tuple[str, ...] = ()
    none: str = ""
    parts: tuple[Part, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _only_known_names(self) -> Template:
        for place in _quoted(self.none):
            _require_known(place, ("name", "edition", "least"), "quantity")
        for table in self.tables:
            _require_known(table, TABLES, "table")
        for part in self.parts:
            for quantity in (*part.states, *part.limits_m, *filter(None, (part.class_of,))):
                _require_known(quantity, tuple(QUANTITIES), "quantity")
            for text in part.texts.model_dump().values():
                for place in _quoted(text):
                    _require_known(place, (*_PLACES, *QUANTITIES), "quantity")
            limited = bool(part.limits_m or part.class_of)
            if limited and not (part.texts.met and part.texts.missed):
                raise ValueError("a part with limits needs the texts met and missed")
        return self


@cache
def delivered(standard: Standard) -> Template:
    """The template of a published standard."""
    return read_template(_DELIVERED / f"{standard}.toml")


def read_template(path: Path) -> Template:
    """A template from its file.

    Raises
    ------
    InputError
        If it cannot be read, is no TOML, or holds what a template does not know.
    """
    try:
        return Template.model_validate(_content(path))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"]))
        what = str(first["msg"]).removeprefix("Value error, ")
        where = f" ({place})" if place else ""
        end = "" if what.endswith((".", "?")) else "."
        raise Location(path).error(f"The template cannot be used{where}: {what}{end}", _REMEDY) from error


def _content(path: Path) -> Mapping[str, object]:
    try:
        return tomllib.loads(read_delivered(path.resolve(), "settings").decode("utf-8"))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise Location(path).error(f"The template is not a TOML file: {error}.", _REMEDY) from error


def _quoted(text: str) -> list[str]:
    """The names in braces."""
    names = []
    for _, name, how, conversion in string.Formatter().parse(text):
        if name is not None:
            if how or conversion:
                raise ValueError(f"a text quotes names as they are, without ':{how}'")
            names.append(name)
    return names


def _require_known(name: str, known: tuple[str, ...], what: str) -> None:
    if name not in known:
        raise ValueError(f"unknown {what} '{name}'. {did_you_mean(name, known)}")
