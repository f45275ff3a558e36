"""A result in one line, and as the page that a notebook shows."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from adjust.result_columns import parameter_rows

if TYPE_CHECKING:
    from adjust.result import AdjustmentResult

# So many parameters are shown; a table of hundreds is not a summary.
_SHOWN = 30


def one_line(result: AdjustmentResult) -> str:
    """Size of the block, σ0 with its limits, redundancy and rejected observations."""
    return f"<AdjustmentResult: {', '.join(' '.join(pair) for pair in _figures(result))}>"


def page(result: AdjustmentResult) -> str:
    """The same as HTML, with a table of the groups and one of the estimated parameters."""
    rows = parameter_rows(result)
    groups = [
        (
            item.group.name,
            f"{int(np.isfinite(item.sigma).sum()):,}",
            f"{item.rejected:,}",
            f"{item.redundancy_sum:,.1f}",
            f"{item.sigma0:.3f}" if np.isfinite(item.sigma0) else "–",
        )
        for item in result.groups
    ]
    parameters = [
        (row.name, row.entity, f"{row.value:.9g}", f"{row.sigma:.3g}", row.unit) for row in rows[:_SHOWN]
    ]
    more = f"<p>… {len(rows):,} estimated parameters in all</p>" if len(rows) > _SHOWN else ""
    return (
        _table((), _figures(result))
        + _table(("observations", "components", "rejected", "redundancy", "σ0"), groups)
        + (_table(("parameter", "of", "estimated", "σ", "unit"), parameters) if rows else "")
        + more
    )


def _table(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """A table whose first column names the rows."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join(
        f"<tr><th>{escape(first)}</th>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"
        for first, *cells in rows
    )
    return f"<table>{f'<tr>{head}</tr>' if head else ''}{body}</table>"


def _figures(result: AdjustmentResult) -> list[tuple[str, str]]:
    """What the figures are of, and the figures."""
    test = result.test
    figures = [
        ("images", f"{len(result.block.images):,}"),
        ("object points", f"{int(result.active_point.sum()):,}"),
        ("estimated system parameters", f"{result.layout.border:,}"),
        ("σ0", _sigma0(result)),
        ("redundancy", f"{test.redundancy:,}"),
        ("rejected observations", f"{sum(item.rejected for item in result.groups):,}"),
        ("iterations", f"{sum(len(steps) for steps in result.iterations):,}"),
    ]
    if result.free_network is not None:
        figures.append(("open datum directions", f"{result.free_network.defect}"))
    return figures


def _sigma0(result: AdjustmentResult) -> str:
    test = result.test
    if test.redundancy <= 0:
        return "no"
    verdict = "within" if test.passed else "outside"
    return f"{test.sigma0:.3f} ({verdict} {test.lower:.3f} … {test.upper:.3f})"
