"""Every parameter of a camera over its calibrations: σ bars, validity, and the limits of a drift."""

from __future__ import annotations

from datetime import date, timedelta
from typing import Any

from flows.overview.trend_figures import BLUE, GREY, ORANGE, Figure, layout
from tasks.quantities import quantity_words, shown
from tasks.registry.series import SeriesPoint
from tasks.registry.watch import RegistryWatch, WatchedSeries

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
    """One parameter; values count from that of the first calibration that is shown, as people speak of it."""
    points = series.series.points
    zero = points[0].value
    unit, factor, _ = shown(series.series.unit, "change")
    traces = [_of_state(state, points, zero, factor, unit) for state in _STATES]
    figure = layout(f"change [{unit}]")
    figure["title"] = {
        "text": f"<b>{quantity_words(series.series.parameter)}</b>",
        "font": {"size": 13},
        "x": 0.02,
        "y": 0.97,
    }
    figure["margin"] = {**figure["margin"], "t": 58}
    figure["shapes"] = [*_validity(series, today), *_limits(series, zero, factor)]
    figure["height"] = 250
    return {"data": [one for one in traces if one["x"]], "layout": figure}


def _of_state(state: str, points: tuple[SeriesPoint, ...], zero: float, factor: float, unit: str) -> Figure:
    colour, symbol = _STATES[state]
    shown = [point for point in points if point.state == state]
    return {
        "type": "scatter",
        "mode": "markers",
        "name": state,
        "x": [point.day.isoformat() for point in shown],
        "y": [(point.value - zero) * factor for point in shown],
        "error_y": {"type": "data", "array": [point.sigma * factor for point in shown], "color": colour,
                    "thickness": 1.5, "width": 5},
        "marker": {"color": colour, "symbol": symbol, "size": 9, "line": {"width": 2, "color": colour}},
        "customdata": [[point.calibration, _held(point)] for point in shown],
        "hovertemplate": f"calibration %{{customdata[0]}} ({state})<br>%{{x}}<br>%{{y:.4g}} {unit}"
        "<br>%{customdata[1]}<extra></extra>",
    }  # fmt: skip


def _held(point: SeriesPoint) -> str:
    return "not in force" if point.validity is None else f"in force {point.validity}"


def _validity(series: WatchedSeries, today: date) -> list[dict[str, Any]]:
    """The days on which an approved calibration holds, as bars at the foot of the plot."""
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


def _limits(series: WatchedSeries, zero: float, factor: float) -> list[dict[str, Any]]:
    """Within what the newest one should lie, counted from the calibrations it is compared with."""
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
