"""What may be said about accuracy, from differences at independent check points.

ASPRS, from edition 2 on: with the radial RMSE of the differences RMSE_H1 = √(RMSE_X² + RMSE_Y²) and that of
the survey RMSE_H2,

    RMSE_H = √(RMSE_H1² + RMSE_H2²),    RMSE_V likewise,    RMSE_3D = √(RMSE_H² + RMSE_V²).

NSSDA: Accuracy_r = 2.4477 · ½ (RMSE_x + RMSE_y), Accuracy_z = 1.9600 RMSE_z. None of the RMSE is centred.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Bools, Floats
from tasks.accuracy.standard import AsprsStandard, NssdaStandard, asprs, nssda
from tasks.files.json_text import JSON

_CM = 100.0


@dataclass(frozen=True, eq=False)
class CheckPointDifferences:
    """Differences at the n independent check points.

    Attributes
    ----------
    difference : (n, 3) computed − given along east, north, up, metres; NaN where not known.
    survey_sigma : (n, 3) standard deviations of the given coordinates, metres.
    """

    difference: Floats
    survey_sigma: Floats

    @property
    def has_plan(self) -> Bools:
        """(n,) points with both plan coordinates."""
        return np.asarray(np.isfinite(self.difference[:, :2]).all(axis=1))

    @property
    def has_height(self) -> Bools:
        """(n,) points with a height."""
        return np.asarray(np.isfinite(self.difference[:, 2]))

    @property
    def number(self) -> int:
        """How many points test plan and height: the smaller of the two numbers."""
        return int(min(self.has_plan.sum(), self.has_height.sum()))

    @property
    def rmse(self) -> tuple[float, float, float]:
        """RMSE of x, y, z, metres; not centred."""
        plan, height = self.difference[self.has_plan, :2], self.difference[self.has_height, 2]
        return _rms(plan[:, 0]), _rms(plan[:, 1]), _rms(height)

    @property
    def survey_rmse(self) -> tuple[float, float]:
        """RMSE of the survey, radial and in height, metres."""
        plan, height = self.survey_sigma[self.has_plan, :2], self.survey_sigma[self.has_height, 2]
        return _rms(np.hypot(plan[:, 0], plan[:, 1])), _rms(height)


@dataclass(frozen=True)
class AccuracyClass:
    """Accuracy class that a delivery must meet: RMSE_H and RMSE_V, metres."""

    horizontal_m: float
    vertical_m: float


@dataclass(frozen=True)
class Statement:
    """What may be said according to one standard.

    Attributes
    ----------
    standard, edition : which.
    tested : whether there are enough check points for a statement.
    check_points, least : how many there are and are needed.
    figures : the figures of the standard, metres.
    sentence : in words.
    """

    standard: str
    edition: str
    tested: bool
    check_points: int
    least: int
    figures: dict[str, float]
    sentence: str

    def to_json(self) -> JSON:
        """For summary.json."""
        return {
            "standard": self.standard,
            "edition": self.edition,
            "tested": self.tested,
            "check_points": self.check_points,
            "check_points_needed": self.least,
            "figures_m": dict(self.figures),
            "sentence": self.sentence,
        }


def statements(found: CheckPointDifferences, wanted: AccuracyClass | None) -> tuple[Statement, ...]:
    """Statements according to every standard, in the editions in use."""
    return asprs_statement(found, wanted, asprs()), nssda_statement(found, nssda())


def asprs_statement(
    found: CheckPointDifferences, wanted: AccuracyClass | None, standard: AsprsStandard
) -> Statement:
    """Statement according to the ASPRS standards."""
    words = standard.statements
    places = {"name": standard.name, "edition": standard.edition, "least": str(standard.least_check_points)}
    n = found.number
    if n == 0:
        return _statement(standard, 0, {}, words["none"].format(**places))
    (x, y, z), (survey_h, survey_v) = found.rmse, found.survey_rmse
    rmse_h, rmse_v = float(np.hypot(np.hypot(x, y), survey_h)), float(np.hypot(z, survey_v))
    figures = {"RMSE_H": rmse_h, "RMSE_V": rmse_v, "RMSE_3D": float(np.hypot(rmse_h, rmse_v))}
    places |= {name.lower(): f"{value * _CM:.1f}" for name, value in figures.items()} | {"n": f"{n:,}"}
    if n < standard.least_check_points:
        return _statement(standard, n, figures, words["too_few"].format(**places))
    opening = words["no_class"]
    if wanted is not None:
        places["horizontal_class"] = f"{wanted.horizontal_m * _CM:g}"
        places["vertical_class"] = f"{wanted.vertical_m * _CM:g}"
        met = rmse_h <= wanted.horizontal_m and rmse_v <= wanted.vertical_m
        opening = words["class" if met else "class_missed"]
    return _statement(standard, n, figures, f"{opening} {words['found']}".format(**places))


def nssda_statement(found: CheckPointDifferences, standard: NssdaStandard) -> Statement:
    """Statement according to the NSSDA."""
    words = standard.statements
    places = {"name": standard.name, "edition": standard.edition, "least": str(standard.least_check_points)}
    n = found.number
    if n == 0:
        return _statement(standard, 0, {}, words["none"].format(**places))
    x, y, z = found.rmse
    ratio = min(x, y) / max(x, y) if max(x, y) > 0.0 else 1.0
    figures = {"Accuracy_z": standard.vertical_factor * z}
    if ratio >= standard.least_ratio:
        figures["Accuracy_r"] = standard.horizontal_factor * 0.5 * (x + y)
    places |= {name.lower(): f"{value:.3f}" for name, value in figures.items()}
    places |= {"rmse_x": f"{x:.3f}", "rmse_y": f"{y:.3f}", "rmse_z": f"{z:.3f}", "n": f"{n:,}"}
    places |= {"ratio": f"{ratio:.2f}", "least_ratio": f"{standard.least_ratio:g}"}
    case = "found" if ratio >= standard.least_ratio else "not_circular"
    case = case if n >= standard.least_check_points else "too_few"
    return _statement(standard, n, figures, words[case].format(**places))


def _statement(
    standard: AsprsStandard | NssdaStandard, n: int, figures: dict[str, float], sentence: str
) -> Statement:
    least = standard.least_check_points
    return Statement(standard.name, standard.edition, n >= least, n, least, figures, sentence)


def _rms(values: Floats) -> float:
    """Root mean square, not centred; NaN without values."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")
