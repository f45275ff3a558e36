"""sweep.html: the scenarios of a sweep, next to a published table if the project requests one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
from markupsafe import Markup

from tasks.document_kit import axes, markup, palette
from tasks.document_kit.axes import Scale
from tasks.document_kit.legend import Swatch, swatches
from tasks.document_kit.table import Table
from tasks.document_kit.templates import rendered
from tasks.documents.report.page import TEMPLATES as REPORT_TEMPLATES
from tasks.documents.sweep.image_maps import error_maps, image_maps, residual_maps
from tasks.sweep.result_tables import (
    ROLES,
    SweepResults,
    block_table,
    failure_table,
    gsd_table,
    has_points,
    in_gsd,
    largest_table,
    residual_table,
    rms_table,
    shown_role,
    variant_table,
)
from tasks.sweep.scenario import Computed

_AXES = ("x", "y", "z")
_LEFT, _RIGHT, _TOP = 78.0, 12.0, 10.0
_PANEL, _GAP = 150.0, 34.0
# Part of the width of a group that its bars take.
_FILLED = 0.82


def rmse_bars(results: SweepResults, block: str) -> Markup:
    """Three panels (X, Y, Z) for a sub-block; a line across a bar is the published number."""
    scenarios = results.of_block(block)
    groups = list(dict.fromkeys(scenarios["control"]))
    variants = list(dict.fromkeys(results.table["variant"]))
    bars = [_Bar(results, row, groups, variants) for _, row in scenarios.iterrows()]
    largest = max((bar.largest for bar in bars), default=1.0)
    right = axes.WIDTH - _RIGHT
    place = Scale(0.0, float(max(len(groups), 1)), _LEFT, right)
    parts: list[Markup] = []
    for panel, axis in enumerate(_AXES):
        top = _TOP + panel * (_PANEL + _GAP)
        height = Scale(0.0, 1.08 * largest, top + _PANEL, top)
        parts.append(axes.vertical_axis(height, _LEFT, right, f"RMS {axis.upper()} [GSD]", about=4))
        parts += [bar.drawn(axis, place, height) for bar in bars]
        parts.append(axes.frame(_LEFT, top, right, top + _PANEL))
        parts += [
            markup.text(place.at(index + 0.5), top + _PANEL + 17, words)
            for index, words in enumerate(_group_words(scenarios, groups))
        ]
    entries = [Swatch(palette.category(index), variant) for index, variant in enumerate(variants)]
    below = _TOP + len(_AXES) * (_PANEL + _GAP)
    legend, bottom = swatches(_LEFT, below, "", entries, right - _LEFT)
    description = f"RMS differences of {block} in ground sampling distances"
    return markup.svg(axes.WIDTH, bottom + 4, description, *parts, legend)


def _group_words(scenarios: pd.DataFrame, groups: list[str]) -> list[str]:
    """Names of the choices of control points; the absence of check points is stated."""
    without = set(scenarios.loc[scenarios["check_points"].fillna(0) == 0, "control"])
    return [f"{group} (at control points)" if group in without else group for group in groups]


class _Bar:
    """The three bars of one scenario."""

    def __init__(self, results: SweepResults, row: pd.Series, groups: list[str], variants: list[str]) -> None:
        role = shown_role(row)
        printed = results.printed(row)
        self.words = f"{row['control']}, {row['variant']}"
        self.group, self.variant = groups.index(row["control"]), variants.index(row["variant"])
        self.width = _FILLED / len(variants)
        self.left = self.group + 0.5 * (1.0 - _FILLED) + self.variant * self.width
        self.ours = {axis: in_gsd(row, row[f"rmse_{role}_{axis}_m"]) for axis in _AXES}
        self.printed = {axis: in_gsd(row, printed.get(f"rmse_{role}_{axis}_m")) for axis in _AXES}

    @property
    def largest(self) -> float:
        """The largest number shown."""
        values = [value for value in (*self.ours.values(), *self.printed.values()) if value is not None]
        return max((value for value in values if math.isfinite(value)), default=1.0)

    def drawn(self, axis: str, place: Scale, height: Scale) -> Markup:
        """The bar of an axis, with the published number across it."""
        ours, printed = self.ours[axis], self.printed[axis]
        left, right = place.at(self.left), place.at(self.left + self.width)
        parts: list[Markup] = []
        if ours is not None and math.isfinite(ours):
            top = height.at(ours)
            width, colour = right - left - 1.0, palette.category(self.variant)
            words = f"{self.words}: {axis.upper()} {ours:.2f} GSD"
            if printed is not None:
                words += f", published {printed:.2f}"
            told = markup.title(words)
            parts.append(markup.rectangle(left, top, width, height.start - top, told, fill=colour))
        if printed is not None:
            parts.append(markup.line(left - 1.0, height.at(printed), right, height.at(printed)))
        return markup.group("bar", parts)


_TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class _BlockSection:
    """What the page shows of a sub-block; the maps are of the choice of control points `mapped`."""

    name: str
    bars: Markup
    mapped: str
    residuals: Markup | None
    errors: Markup | None
    tables: tuple[Table, ...]


def render(results: SweepResults, computed: Sequence[Computed], name: str, versions: Table) -> str:
    """The page as text."""
    failures = failure_table(results)
    return rendered(
        "sweep.html.j2",
        _TEMPLATES,
        REPORT_TEMPLATES,
        name=name,
        sentence=_sentence(results),
        failures=failures,
        published=results.published,
        blocks=[
            _section(results, computed, block) for block in results.blocks if len(results.of_block(block))
        ],
        sub_blocks=block_table(results),
        variants=variant_table(results),
        versions=versions,
    )


def _section(results: SweepResults, computed: Sequence[Computed], block: str) -> _BlockSection:
    own, maps = results.of_block(block), image_maps(computed, block)
    roles = [role for role in ROLES if len(has_points(own, role))]
    return _BlockSection(
        block,
        rmse_bars(results, block),
        str(own["control"].iloc[0]),
        residual_maps(maps),
        error_maps(maps),
        (
            *(rms_table(results, block, role) for role in roles),
            *(largest_table(results, block, role) for role in roles),
            gsd_table(results, block),
            residual_table(results, block),
        ),
    )


def _sentence(results: SweepResults) -> str:
    """How many scenarios there are, and how many of them have no result."""
    table = results.table
    failed = int((table["status"] != "done").sum())
    names = {"block": "sub-block", "control": "choice of control points", "variant": "variant"}
    varied = ", ".join(_counted(table[column].nunique(), words) for column, words in names.items())
    computed = "all were computed" if not failed else f"{failed} could not be computed"
    return f"{_counted(len(table), 'scenario')} ({varied}); {computed}."


def _counted(number: int, words: str) -> str:
    """A number with its noun in the right form."""
    first, *others = words.split()
    return " ".join([str(number), first if number == 1 else f"{first}s", *others])
