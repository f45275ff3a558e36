"""σ0 and check RMSE over projects in time, with the limits of their gates."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

from tasks.production.project_row import TrendPoint, any_of

Figure = dict[str, Any]

#: Colours that stay apart for colour-blind readers (Okabe and Ito), as in the reports.
BLUE, ORANGE, GREEN, PINK, GREY, INK = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#7b8794", "#1f2933"
_AXES = (("x", BLUE, "circle"), ("y", GREEN, "square"), ("z", PINK, "diamond"))


def sigma0_figure(points: Sequence[TrendPoint]) -> Figure | None:
    """σ0 of every project; None without any."""
    shown = [point for point in points if point.sigma0 is not None]
    if not shown:
        return None
    traces = [
        _limits(shown, [point.sigma0_limit for point in shown], "gate"),
        *(
            _figures(
                [point for point in shown if point.passed == passed],
                lambda point: point.sigma0,
                name,
                {"color": colour, "symbol": symbol, "size": 9},
                "σ0 %{y:.3f}",
            )
            for passed, name, colour, symbol in (
                (True, "passed", BLUE, "circle"),
                (False, "a gate failed", ORANGE, "triangle-up"),
            )
        ),
    ]
    return {"data": [one for one in traces if one["x"]], "layout": layout("σ0")}


def rmse_figure(points: Sequence[TrendPoint]) -> Figure | None:
    """RMSE of the check points of every project, x, y and z; None without any."""
    shown = [point for point in points if any_of(point.rmse_check_m)]
    if not shown:
        return None
    traces = []
    for index, (axis, colour, symbol) in enumerate(_AXES):
        there = [point for point in shown if point.rmse_check_m[index] is not None]
        limits = [point.rmse_limit_m[index] for point in there]
        traces.append(_limits(there, limits, f"gate {axis}", colour))
        marker = {"color": colour, "symbol": symbol, "size": 8}
        traces.append(
            _figures(there, lambda p, i=index: p.rmse_check_m[i], axis, marker, axis + " %{y:.3f} m")
        )
    return {
        "data": [one for one in traces if one["x"]],
        "layout": layout("RMSE [m]", type="log", dtick="D2", tickformat=".3~f"),
    }


def _figures(points: Sequence[TrendPoint], value: Any, name: str, marker: Figure, told: str) -> Figure:
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "x": [point.ended.isoformat(timespec="seconds") for point in points],
        "y": [value(point) for point in points],
        # Texts over a plot may hold marks of their own; a project's name is none.
        "customdata": [[escape(point.project), escape(point.story), point.run] for point in points],
        "marker": marker,
        "hovertemplate": f"<b>%{{customdata[0]}}</b><br>%{{customdata[1]}}<br>{told}<extra></extra>",
    }


def _limits(
    points: Sequence[TrendPoint], limits: Sequence[float | None], name: str, colour: str = INK
) -> Figure:
    """A short stroke at the limit of each project that has one."""
    found = [(point, limit) for point, limit in zip(points, limits, strict=True) if limit is not None]
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "x": [point.ended.isoformat(timespec="seconds") for point, _ in found],
        "y": [limit for _, limit in found],
        "marker": {"symbol": "line-ew", "size": 14, "line": {"color": colour, "width": 1.5}},
        "hovertemplate": f"{name} %{{y:.4g}}<extra></extra>",
    }


def layout(title: str, **axis: Any) -> Figure:
    """What all plots of the page share.

    Parameters
    ----------
    title, axis : of the vertical axis.
    """
    grid = {
        "exponentformat": "power",
        "gridcolor": "#e8ecef",
        "linecolor": "#b6c0c9",
        "zeroline": False,
        "automargin": True,
    }
    return {
        "height": 280,
        "margin": {"l": 56, "r": 12, "t": 10, "b": 36},
        "paper_bgcolor": "#fff",
        "plot_bgcolor": "#fff",
        "font": {"family": "system-ui, 'DejaVu Sans', sans-serif", "size": 12, "color": INK},
        "xaxis": {**grid, "type": "date"},
        "yaxis": {**grid, "title": {"text": title}, **axis},
        "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        "hovermode": "closest",
        # What somebody has zoomed to stays when new points come.
        "uirevision": "kept",
    }
