"""Elements, scales, legends and colours of the plots."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from markupsafe import Markup

from tasks.document_kit import axes, markup, palette
from tasks.document_kit.axes import Scale, round_length, tick_step, tick_texts
from tasks.document_kit.difference_arrows import ArrowScale
from tasks.document_kit.map_plot import MapPlot
from tasks.documents.report.block_map import _points
from tasks.documents.report.export import drawing_rules
from tasks.documents.report.page import TEMPLATES


def test_texts_and_attributes_are_escaped_and_markup_is_not() -> None:
    made = markup.element("g", "<i>", Markup("<use/>"), css='"><b>')
    assert made == '<g class="&#34;&gt;&lt;b&gt;">&lt;i&gt;<use/></g>'


def test_coordinates_are_rounded_to_a_tenth_without_needless_digits() -> None:
    assert [markup.number(v) for v in (1.0, 1.04, 1.06, -0.04, 120.0, -3.25)] == [
        "1",
        "1",
        "1.1",
        "0",
        "120",
        "-3.2",
    ]


def test_an_arrow_ends_where_it_points() -> None:
    moves = re.findall(r"[ML](-?[\d.]+),(-?[\d.]+)", markup.arrow(10.0, 20.0, 30.0, -40.0))
    points = [(float(x), float(y)) for x, y in moves]
    assert points[0] == (10.0, 20.0)
    assert points[1] == points[3] == (40.0, -20.0)
    # Both barbs are equally long and lie behind the tip.
    lengths = [np.hypot(x - 40.0, y + 20.0) for x, y in (points[2], points[4])]
    assert lengths[0] == pytest.approx(lengths[1], abs=0.1)
    assert all(np.dot([x - 40.0, y + 20.0], [30.0, -40.0]) < 0 for x, y in (points[2], points[4]))


def test_a_vanishing_arrow_is_a_dot() -> None:
    assert markup.arrow(1.0, 2.0, 0.0, 0.0) == "M1,2h0.1"


def test_a_scale_maps_its_ends_and_is_straight_between() -> None:
    scale = Scale(2.0, 4.0, 100.0, 0.0)
    assert scale.of(np.array([2.0, 3.0, 4.0])) == pytest.approx([100.0, 50.0, 0.0])
    assert scale.at(2.5) == pytest.approx(75.0)


@pytest.mark.parametrize(("lower", "upper"), [(0.0, 1.0), (-3.7, 12.2), (6450.3, 6463.1), (0.0, 3e-4)])
def test_ticks_are_round_evenly_spaced_and_inside(lower: float, upper: float) -> None:
    ticks = Scale(lower, upper, 0.0, 1.0).ticks(6)
    step = np.diff(ticks)
    assert 2 <= len(ticks) <= 14
    assert step == pytest.approx(np.full(len(step), step[0]))
    assert f"{step[0]:.0e}"[0] in "125"
    assert lower - 1e-9 <= min(ticks) <= max(ticks) <= upper + 1e-9


def test_texts_of_ticks_have_the_decimals_of_their_step() -> None:
    assert tick_texts((-0.5, 0.0, 0.5)) == ("−0.5", "0.0", "0.5")
    assert tick_texts((6450.0, 6460.0)) == ("6450", "6460")
    assert tick_texts((0.0, 20000.0)) == ("0", "20,000")


@pytest.mark.parametrize(
    ("largest", "expected"), [(0.7, 0.5), (1.0, 1.0), (4.99, 2.0), (73.0, 50.0), (0.0, 1.0)]
)
def test_a_scale_bar_has_a_round_length_not_above_the_largest(largest: float, expected: float) -> None:
    assert round_length(largest) == pytest.approx(expected)


def test_a_step_divides_into_about_as_many_parts() -> None:
    assert [tick_step(extent, 5) for extent in (1.0, 10.0, 12.0, 0.03)] == pytest.approx(
        [0.2, 2.0, 5.0, 0.01]
    )


def test_a_map_keeps_angles_and_shows_all_points() -> None:
    x, y = np.array([500_000.0, 512_000.0]), np.array([6_000_000.0, 6_002_000.0])
    plot = MapPlot.over(x, y)
    assert plot.x.unit == pytest.approx(-plot.y.unit)
    assert all(plot.x.start < v < plot.x.end for v in plot.x.of(x))
    assert all(plot.y.end < v < plot.y.start for v in plot.y.of(y))
    assert plot.y.at(y[1]) < plot.y.at(y[0])


def test_the_legend_below_the_narrow_map_of_a_single_strip_is_not_cut_off() -> None:
    plot = MapPlot.over(np.array([0.0, 100.0]), np.array([0.0, 3000.0]))
    drawn, _ = _points(pd.DataFrame(), ArrowScale(460.0, 0.1), plot, 0.0)
    texts = re.findall(r'<text x="([\d.]+)"[^>]*>([^<]*)</text>', drawn)
    assert texts[-1][1] == "height, up = computed higher"
    assert max(float(x) + 7.2 * len(words) for x, words in texts) < axes.WIDTH


def test_rules_of_an_exported_drawing_weigh_as_on_the_page_where_later_ones_win() -> None:
    """Arrows of the height would have the colour of those in plan: every selector loses the same element."""
    rules = drawing_rules((TEMPLATES / "style.css").read_text(encoding="utf-8"))
    assert ".plan, .height {" in rules
    assert not re.search(r"\bsvg \.", rules)


def _lightness(colour: str) -> float:
    """Relative luminance, as a grey printer sees a colour."""
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return 0.2126 * red**2.2 + 0.7152 * green**2.2 + 0.0722 * blue**2.2


@pytest.mark.parametrize("count", [2, 5, 11])
def test_a_sequence_of_colours_keeps_its_order_without_hue(count: int) -> None:
    lightness = [_lightness(colour) for colour in palette.sequence(count)]
    assert lightness == sorted(lightness, reverse=True)
    assert len(set(palette.sequence(count))) == count


def test_signed_colours_are_white_at_zero_and_mirror_in_strength() -> None:
    assert palette.signed(0.0) == "#ffffff"
    assert palette.signed(1.0) != palette.signed(-1.0)
    assert palette.signed(2.0) == palette.signed(1.0)


def test_categories_repeat_only_after_all_are_used() -> None:
    assert len({palette.category(index) for index in range(8)}) == 8
    assert palette.category(8) == palette.category(0)
