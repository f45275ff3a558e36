"""The plots of the production page: figures over projects in time, parameters over calibrations.

Each with its limits: gates as short strokes, the limits of a drift as lines, validity as bars.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date, timedelta
from html import escape
from typing import TYPE_CHECKING, Any
from zoneinfo import ZoneInfo

from tasks.production.board import ProjectRow
from tasks.quantities import shown

if TYPE_CHECKING:
    from tasks.registry.series import SeriesPoint
    from tasks.registry.watch import RegistryWatch, WatchedSeries

Figure = dict[str, Any]

#: Colours that stay apart for colour-blind readers (Okabe and Ito), as in the reports.
BLUE, ORANGE, GREEN, PINK, GREY, INK = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#7b8794", "#1f2933"
_AXES = (("x", BLUE, "circle"), ("y", GREEN, "square"), ("z", PINK, "diamond"))


def sigma0_figure(rows: Sequence[ProjectRow], zone: ZoneInfo) -> Figure | None:
    """σ0 of every project; None without any."""
    found = [row for row in rows if row.run.figures.sigma0 is not None]
    if not found:
        return None
    kinds = (("passed", BLUE, "circle"), ("a gate failed", ORANGE, "triangle-up"))
    traces = [
        _gate_strokes(found, zone, "sigma0", "gate"),
        *(
            _figures(
                [row for row in found if (row.run.state == "Completed") == (name == "passed")],
                zone,
                lambda row: row.run.figures.sigma0,
                name,
                {"color": colour, "symbol": symbol, "size": 9},
                "σ0 %{y:.3f}",
            )
            for name, colour, symbol in kinds
        ),
    ]
    return {"data": [one for one in traces if one["x"]], "layout": layout("σ0")}


def rmse_figure(rows: Sequence[ProjectRow], zone: ZoneInfo) -> Figure | None:
    """RMSE of the check points of every project, x, y and z; None without any."""
    traces = []
    for index, (axis, colour, symbol) in enumerate(_AXES):
        there = [row for row in rows if row.run.figures.rmse_check_m[index] is not None]
        traces.append(_gate_strokes(there, zone, f"rmse_check_m_{axis}", f"gate {axis}", colour))
        marker = {"color": colour, "symbol": symbol, "size": 8}
        told = axis + " %{y:.3f} m"
        traces.append(
            _figures(there, zone, lambda row, i=index: row.run.figures.rmse_check_m[i], axis, marker, told)
        )
    drawn = [one for one in traces if one["x"]]
    axis_of_figures = layout("RMSE [m]", type="log", dtick="D2", tickformat=".3~f")
    return {"data": drawn, "layout": axis_of_figures} if drawn else None


def _figures(
    rows: Sequence[ProjectRow], zone: ZoneInfo, value: Any, name: str, marker: Figure, told: str
) -> Figure:
    """The figure of each project at the end of its run, as points with what they are."""
    # Plotly takes some HTML in what it shows under the pointer.
    about = [[escape(row.run.project), escape(row.run.story), row.run.id] for row in rows]
    told = f"<b>%{{customdata[0]}}</b><br>%{{customdata[1]}}<br>{told}"
    return _points(name, _ends(rows, zone), [value(row) for row in rows], marker, told, customdata=about)


def _gate_strokes(
    rows: Sequence[ProjectRow], zone: ZoneInfo, gate: str, name: str, colour: str = INK
) -> Figure:
    """The limit of a gate at each project that has it."""
    found = [(row, limit) for row in rows if (limit := row.limit(gate)) is not None]
    marker = {"symbol": "line-ew", "size": 14, "line": {"color": colour, "width": 1.5}}
    limits = [limit for _, limit in found]
    return _points(name, _ends([row for row, _ in found], zone), limits, marker, f"{name} %{{y:.4g}}")


def _ends(rows: Sequence[ProjectRow], zone: ZoneInfo) -> list[str]:
    # As the other times of the page; Plotly would show UTC.
    return [f"{row.changed.astimezone(zone):%Y-%m-%dT%H:%M:%S}" for row in rows]


def _points(name: str, x: list[str], y: list[Any], marker: Figure, told: str, **more: Any) -> Figure:
    """Points of a plot; `told` is what the pointer shows."""
    trace = {"type": "scatter", "mode": "markers", "name": name, "x": x, "y": y, "marker": marker}
    return {**trace, "hovertemplate": f"{told}<extra></extra>", **more}


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


#: Colour and symbol of a calibration by its state.
_STATES = {
    "approved": (BLUE, "circle"),
    "superseded": (GREY, "circle"),
    "draft": (ORANGE, "circle-open"),
}
_OPEN_END = timedelta(days=60)


def cameras_of(watch: RegistryWatch) -> list[dict[str, str]]:
    """The cameras to choose from: those that are due come first."""
    in_use = [one for one in watch.cameras if one.in_use]
    return [
        {
            "label": f"{one.camera}, {one.product}" + (" (due)" if one.is_due else ""),
            "value": one.camera_key,
        }
        for one in sorted(in_use, key=lambda one: (not one.is_due, one.camera))
    ]


def series_figure(series: WatchedSeries, today: date) -> Figure:
    """One parameter; values are differences from the first calibration shown, to which people refer."""
    points = series.series.points
    zero = points[0].value
    unit, factor, _ = shown(series.series.unit, "change")
    traces = [_of_state(state, points, zero, factor, unit) for state in _STATES]
    figure = layout(f"change [{unit}]")
    figure["title"] = {
        "text": f"<b>{escape(series.series.words)}</b>",
        "font": {"size": 13},
        "x": 0.02,
        "y": 0.97,
    }
    figure["margin"] = {**figure["margin"], "t": 58}
    figure["shapes"] = [*_validity(series, today), *_drift_lines(series, zero, factor)]
    figure["height"] = 250
    return {"data": [one for one in traces if one["x"]], "layout": figure}


def _of_state(state: str, points: tuple[SeriesPoint, ...], zero: float, factor: float, unit: str) -> Figure:
    colour, symbol = _STATES[state]
    shown = [point for point in points if point.state == state]
    sigmas = [point.sigma * factor for point in shown]
    return _points(
        state,
        [point.day.isoformat() for point in shown],
        [(point.value - zero) * factor for point in shown],
        {"color": colour, "symbol": symbol, "size": 9, "line": {"width": 2, "color": colour}},
        f"calibration %{{customdata[0]}} ({state})<br>%{{x}}<br>%{{y:.4g}} {unit}<br>%{{customdata[1]}}",
        error_y={"type": "data", "array": sigmas, "color": colour, "thickness": 1.5, "width": 5},
        customdata=[[point.calibration, _held(point)] for point in shown],
    )


def _held(point: SeriesPoint) -> str:
    return "not in force" if point.validity is None else f"in force {point.validity}"


def _validity(series: WatchedSeries, today: date) -> list[dict[str, Any]]:
    """Periods of validity of approved calibrations, as bars at the bottom of the plot."""
    last = today + _OPEN_END
    return [
        {
            "type": "rect", "xref": "x", "yref": "paper", "y0": 0, "y1": 0.035,
            "x0": point.validity.start.isoformat(),
            "x1": min(point.validity.end or last, last).isoformat(),
            "fillcolor": BLUE if point.state == "approved" else GREY, "opacity": 0.45, "line": {"width": 0},
        }
        for point in series.series.points
        if point.validity is not None
    ]  # fmt: skip


def _drift_lines(series: WatchedSeries, zero: float, factor: float) -> list[dict[str, Any]]:
    """Limits of the newest calibration, counted from the calibrations it is compared with."""
    dashes = {"before": "dash", "first": "dot"}
    return [
        {
            "type": "line", "xref": "paper", "x0": 0, "x1": 1, "yref": "y",
            "y0": (level - zero) * factor, "y1": (level - zero) * factor,
            "line": {"color": ORANGE if band.exceeded else GREY, "width": 1.2, "dash": dashes[band.against]},
        }
        for band in series.bands
        for level in (band.lower, band.upper)
    ]  # fmt: skip
