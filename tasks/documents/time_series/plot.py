"""A parameter of a camera over its calibrations: σ bars, and the limits of the approved ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import date

from markupsafe import Markup

from tasks.document_kit import axes, markup, palette
from tasks.document_kit.axes import Scale, tick_step
from tasks.document_kit.table import Number, decimals_for
from tasks.quantities import shown
from tasks.registry.series import ParameterSeries, SeriesPoint

#: Half width of the band around an approved value, in its σ: left by chance once in a thousand times.
LIMIT = 3.29
#: Colour of a calibration by its state.
COLOURS = {"approved": palette.category(0), "superseded": palette.FAINT, "draft": palette.ACCENT}
_HEIGHT, _TOP, _LEFT = 172.0, 10.0, 86.0
_MONTHS = (1, 3, 6, 12, 24, 60, 120)
_MOST_TICKS = 10
_DAYS_OF_MONTH = 30.44
#: Limits of validity that are later than this after the last calibration are outside of the drawing.
_YEARS_AHEAD = 10


def time_scale(series: Sequence[ParameterSeries]) -> Scale:
    """The days that all series of a camera need, as ordinals."""
    days = [point.day for one in series for point in one.points]
    held = [point.validity for one in series for point in one.points if point.validity is not None]
    limits = [day for one in held for day in (one.start, one.end) if day is not None]
    # An end such as 9999-12-31 means that there is none.
    last_year = max(days).year + _YEARS_AHEAD
    days += [day for day in limits if day.year <= last_year]
    first, last = min(days).toordinal(), max(days).toordinal()
    margin = max(0.05 * (last - first), 3 * _DAYS_OF_MONTH)
    return Scale(first - margin, last + margin, _LEFT, axes.WIDTH - 12.0)


def series_plot(series: ParameterSeries, x: Scale) -> Markup:
    """One parameter; the zero of the scale is the value that was approved last, else the last one."""
    reference = reference_of(series)
    unit, factor, _ = shown(series.unit, "change")
    bottom = _TOP + _HEIGHT
    extent = [
        (point.value - reference.value + side * reach * point.sigma) * factor
        for point in series.points
        for side in (-1, 1)
        for reach in (1.0 if point.validity is None else LIMIT,)
    ]
    room = 0.08 * (max(extent) - min(extent))
    y = Scale(min(extent) - room, max(extent) + room, bottom, _TOP)
    step = tick_step(y.upper - y.lower, 5)
    # Powers of ten that no tick can be written with belong to the unit.
    power = 10.0 ** (3 * round(-(decimals_for(step, 1) // 3))) if decimals_for(step, 1) > 5 else 1.0
    scale = Scale(y.lower / power, y.upper / power, y.start, y.end)
    label = f"[{unit}]" if power == 1.0 else f"[{power:.0e} {unit}]"

    def place(value: float) -> float:
        return y.at((value - reference.value) * factor)

    return markup.svg(
        axes.WIDTH,
        bottom + 26,
        f"{series.words} over the calibrations",
        *_bands(series, x, place),
        axes.vertical_axis(scale, x.start, x.end, f"change {label}", about=5),
        _dates(x, bottom),
        *(_symbol(point, series, x, place) for point in series.points),
        axes.frame(x.start, _TOP, x.end, bottom),
    )


def reference_of(series: ParameterSeries) -> SeriesPoint:
    """The calibration that was approved for the latest days, else the last one."""
    held = [point for point in series.points if point.validity is not None]
    return max(held, key=lambda p: (p.validity.start, p.calibration)) if held else series.points[-1]  # type: ignore[union-attr]


def _bands(series: ParameterSeries, x: Scale, place: Callable[[float], float]) -> list[Markup]:
    """For every approved calibration its value and limits over the days on which it holds."""
    drawn = []
    for point in series.points:
        held = point.validity
        if held is None:
            continue
        start = min(x.at(held.start.toordinal()), x.end)
        # The last day belongs to it.
        end = x.end if held.end is None else min(x.at(held.end.toordinal() + 1), x.end)
        high, low = (place(point.value + side * LIMIT * point.sigma) for side in (1, -1))
        drawn.append(markup.rectangle(start, high, end - start, low - high, css="limits"))
        middle = place(point.value)
        drawn.append(markup.group("value", [markup.line(start, middle, end, middle)]))
    return drawn


def _symbol(point: SeriesPoint, series: ParameterSeries, x: Scale, place: Callable[[float], float]) -> Markup:
    """A bar of ± σ with caps, a disc (hollow: a draft), and its numbers for the pointer."""
    at, middle = x.at(point.day.toordinal()), place(point.value)
    high, low = place(point.value + point.sigma), place(point.value - point.sigma)
    colour = COLOURS[point.state]
    n = markup.number
    bar = f"M{n(at)},{n(high)}V{n(low)}M{n(at - 5)},{n(high)}h10M{n(at - 5)},{n(low)}h10"
    decimals = decimals_for(point.sigma)
    words = (
        f"calibration {point.calibration} ({point.state}), "
        f"{'flown' if point.flown else 'added'} {point.day}: {Number(point.value, decimals)} ± "
        f"{Number(point.sigma, decimals)} {series.unit}; {point.mounting}"
    )
    looks: dict[str, markup.Attribute] = {"stroke": colour, "stroke_width": 2}
    fill = "#fff" if point.state == "draft" else colour
    return markup.group(
        "calibration",
        [
            markup.element("path", d=bar, fill="none", **looks),
            markup.circle(at, middle, 5.0, markup.title(words), fill=fill, **looks),
            markup.text(at + 9, middle - 7, str(point.calibration), "start", "halo"),
        ],
    )


def _dates(x: Scale, bottom: float) -> Markup:
    """Ticks at the first days of months or years."""
    months = (x.upper - x.lower) / _DAYS_OF_MONTH
    step = next((s for s in _MONTHS if months / s <= _MOST_TICKS), _MONTHS[-1])
    first, last = (date.fromordinal(int(day)) for day in (x.lower, x.upper))
    lines, texts = [], []
    count = (first.year * 12 + first.month - 1) // step * step
    while count <= last.year * 12 + last.month:
        day = date(count // 12, count % 12 + 1, 1)
        count += step
        if not x.lower <= day.toordinal() <= x.upper:
            continue
        at = x.at(day.toordinal())
        lines.append(markup.line(at, _TOP, at, bottom + 4))
        texts.append(markup.text(at, bottom + 17, str(day.year) if step >= 12 else f"{day:%Y-%m}"))
    return markup.group("axis", [*lines, *texts])
