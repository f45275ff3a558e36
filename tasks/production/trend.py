"""How the figures of production develop from project to project."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from tasks.production.project_row import Axes, ProjectRow

_AXES = ("x", "y", "z")


@dataclass(frozen=True)
class TrendPoint:
    """The figures of one project.

    Attributes
    ----------
    run, project, story : whose they are.
    ended : when they were computed, UTC.
    passed : whether all gates were.
    sigma0, sigma0_limit : a posteriori / a priori, and the largest value its gate lets pass.
    rmse_check_m, rmse_limit_m : of the check points, and the largest values their gate lets pass.
    """

    run: str
    project: str
    story: str
    ended: datetime
    passed: bool
    sigma0: float | None
    sigma0_limit: float | None
    rmse_check_m: Axes
    rmse_limit_m: Axes


def trend_of(rows: Sequence[ProjectRow], most: int = 300) -> tuple[TrendPoint, ...]:
    """The figures of those projects that have any, the latest ones, in the order of time."""
    ended = [
        row for row in rows if row.ended is not None and (row.sigma0 is not None or any_of(row.rmse_check_m))
    ]
    latest = sorted(ended, key=lambda row: (row.changed, row.key))[-most:]
    return tuple(map(_point, latest))


def any_of(figures: Axes) -> bool:
    """Whether there is a figure at all."""
    return any(figure is not None for figure in figures)


def _point(row: ProjectRow) -> TrendPoint:
    x, y, z = (row.limit(f"rmse_check_m_{axis}") for axis in _AXES)
    return TrendPoint(
        row.run,
        row.project,
        row.story,
        row.changed,
        row.state == "Completed",
        row.sigma0,
        row.limit("sigma0"),
        row.rmse_check_m,
        (x, y, z),
    )
