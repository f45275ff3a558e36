"""Accuracy statements from differences at independent check points, in the wording of a template.

ASPRS, from edition 2 on: with the radial RMSE of the differences RMSE_H1 = √(RMSE_X² + RMSE_Y²) and that of
the survey RMSE_H2,

    RMSE_H = √(RMSE_H1² + RMSE_H2²),    RMSE_V likewise,    RMSE_3D = √(RMSE_H² + RMSE_V²).

NSSDA: Accuracy_r = 2.4477 · ½ (RMSE_x + RMSE_y), Accuracy_z = 1.9600 RMSE_z. None of the RMSE is centred.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import asdict, dataclass
from typing import Literal, TypeAlias

from tasks.accuracy.check_points import QUANTITIES, CheckPointDifferences, Points
from tasks.accuracy.template import STANDARDS, Part, Template, delivered
from tasks.files.json_text import JSON, attributes

#: What became of a part: no points, fewer than needed, no value, tested without limits, within, beyond.
Case: TypeAlias = Literal["none", "too_few", "undefined", "found", "met", "missed"]
# A difference that needs more decimals is shown as none.
_MOST_DECIMALS = 9
_PER_METRE = {"m": 1.0, "cm": 100.0, "mm": 1000.0}
_UNCHECKED = "Limits and wording of this template were not checked against the document."


@dataclass(frozen=True)
class AccuracyClass:
    """Accuracy class that a delivery must meet: RMSE_H and RMSE_V, metres."""

    horizontal_m: float
    vertical_m: float

    def of(self, part: Part) -> float:
        """The limit for a part, metres."""
        both = math.hypot(self.horizontal_m, self.vertical_m)
        return {"horizontal": self.horizontal_m, "vertical": self.vertical_m, "both": both}[part.class_from]


@dataclass(frozen=True)
class PartFound:
    """A part of a statement: its points, its outcome, its figures in metres, and those beyond their limit."""

    points: str
    number: int
    case: Case
    figures_m: dict[str, float]
    limits_m: dict[str, float]
    exceeded: tuple[str, ...]
    sentence: str


@dataclass(frozen=True)
class Statement:
    """The statement according to one template.

    Attributes
    ----------
    standard, edition : which.
    verified : what of the template was compared with its document.
    tested : whether every part has enough check points.
    passed : whether it says yes: tested, no limit exceeded, nothing missing.
    check_points, least : how many the part with the fewest has, and how many are needed.
    parts : with their figures and cases.
    sentence : in words.
    """

    standard: str
    edition: str
    verified: str
    tested: bool
    passed: bool
    check_points: int
    least: int
    parts: tuple[PartFound, ...]
    sentence: str

    @property
    def figures(self) -> dict[str, float]:
        """All figures, metres; those of points under vegetation are named accordingly."""
        return {
            name if part.points != "vegetated" else f"{name} vegetated": value
            for part in self.parts
            for name, value in part.figures_m.items()
        }

    def to_json(self) -> JSON:
        """For summary.json and statements.json."""
        return {
            **attributes(self, "standard", "edition", "verified", "tested", "passed", "check_points"),
            "check_points_needed": self.least,
            "figures_m": dict(self.figures),
            "parts": [{**asdict(part), "exceeded": list(part.exceeded)} for part in self.parts],
            "sentence": self.sentence,
        }


def statements(found: CheckPointDifferences, wanted: AccuracyClass | None) -> tuple[Statement, ...]:
    """Statements according to every standard that comes with the program."""
    return tuple(statement(delivered(name), found, wanted) for name in STANDARDS)


def statement(
    template: Template,
    found: CheckPointDifferences,
    wanted: AccuracyClass | None = None,
    missing: Collection[str] = (),
) -> Statement:
    """Statement according to a template.

    Parameters
    ----------
    wanted : the class that is requested; None: none.
    missing : of the tables it requires, those that are not there.
    """
    parts = tuple(
        part
        for one in template.parts
        if (part := _part(template, one, found.of(one.points), wanted)).number or not one.optional
    )
    numbers = [part.number for part in parts]
    said = list(dict.fromkeys(part.sentence for part in parts if part.sentence))
    if max(numbers) == 0 and template.none:
        about = {"name": template.name, "edition": template.edition, "least": template.least_check_points}
        said = [template.none.format_map(about)]
    if max(numbers) == 0 and found.control:
        said.append(
            f"The {found.control:,} control points were used in the adjustment and are no "
            "evidence of accuracy."
        )
    rough = _rough_survey(template, found, wanted)
    if rough:
        said.append(rough)
    if missing:
        said.append(f"NOT complete: the required tables {', '.join(missing)} are missing or empty.")
    if not template.verified:
        said.append(_UNCHECKED)
    tested = min(numbers) >= template.least_check_points
    return Statement(
        standard=template.name,
        edition=template.edition,
        verified=template.verified,
        tested=tested,
        passed=tested and not rough and not missing and all(p.case in ("found", "met") for p in parts),
        check_points=min(numbers),
        least=template.least_check_points,
        parts=parts,
        sentence=" ".join(said),
    )


def _part(
    template: Template, part: Part, found: CheckPointDifferences, wanted: AccuracyClass | None
) -> PartFound:
    number = len(found.difference)
    limits = dict(part.limits_m)
    if part.class_of and wanted is not None:
        limits[part.class_of] = wanted.of(part)
    values = {name: QUANTITIES[name](found) for name in QUANTITIES} if number else {}
    figures = {name: value for name in part.states if math.isfinite(value := values.get(name, math.nan))}
    exceeded = tuple(name for name, limit in limits.items() if not abs(values.get(name, math.nan)) <= limit)
    case = _case(template, part, number, figures, limits, exceeded)
    of_limits = ("_missed" if exceeded else "_met") if limits else ""
    text = getattr(part.texts, case)
    if case == "too_few":
        text = getattr(part.texts, f"too_few{of_limits}") or text
    scale = _PER_METRE[template.unit]
    places = {
        name: f"{value * scale:.{decimals_beyond(value * scale, scale * limit, template.decimals)}f}"
        for name, value in values.items()
        for limit in (limits.get(name, math.nan),)
    }
    places |= {
        "name": template.name,
        "edition": template.edition,
        "n": f"{number:,}",
        "least": f"{template.least_check_points}",
        "class": f"{limits[part.class_of] * scale:g}" if part.class_of in limits else "–",
        "exceeded": ", ".join(
            f"{name} {places.get(name, '–')} above {limits[name] * scale:g} {template.unit}"
            for name in exceeded
        ),
    }
    sentence = text.format_map(_Known(places))
    return PartFound(part.points, number, case, figures, limits, exceeded, sentence)


def decimals_beyond(value: float, limit: float, decimals: int) -> int:
    """Decimals, so many at least, with which a value beyond a limit does not look as if it kept it."""
    value = abs(value)
    while value > limit >= round(value, decimals) and decimals < _MOST_DECIMALS:
        decimals += 1
    return decimals


class _Known(dict[str, str]):
    """Placeholders of a text; one without a value becomes a dash."""

    def __missing__(self, key: str) -> str:
        return "–"


def _case(
    template: Template,
    part: Part,
    number: int,
    figures: dict[str, float],
    limits: dict[str, float],
    exceeded: tuple[str, ...],
) -> Case:
    if number == 0:
        return "none"
    if number < template.least_check_points:
        return "too_few"
    if any(name not in figures for name in part.states):
        return "undefined"
    if not limits:
        return "found"
    return "missed" if exceeded else "met"


def _rough_survey(template: Template, found: CheckPointDifferences, wanted: AccuracyClass | None) -> str:
    """A sentence if the survey of the check points is not accurate enough for the class; otherwise empty."""
    share = template.survey_at_most
    if share is None or wanted is None:
        return ""
    asked: tuple[tuple[str, Points, str, float], ...] = (
        ("plan", "plan", "survey_H", wanted.horizontal_m),
        ("height", "height", "survey_V", wanted.vertical_m),
    )
    rough = []
    for way, points, survey, limit in asked:
        own = found.of(points)  # no class is for points under vegetation
        if len(own.difference) and not QUANTITIES[survey](own) <= share * limit:
            rough.append(way)
    if not rough:
        return ""
    return (
        f"NOT allowed: the survey of the check points in {' and '.join(rough)} is less accurate than "
        f"{share:g} of the class."
    )
