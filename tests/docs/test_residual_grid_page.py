"""The page on residual grids states what its example prints."""

from __future__ import annotations

import re
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = " ".join((REPOSITORY / "docs/theory/residual-grids.md").read_text(encoding="utf-8").split())


def test_the_table_has_the_results_of_the_example() -> None:
    # Its header has all that it prints: tests/test_examples.py.
    printed = (REPOSITORY / "examples/residual_grid.py").read_text(encoding="utf-8").split('"""')[1]
    rows = re.findall(
        r"^ *(\w+): .+?σ0 ([\d.]+) +Z ([\d.]+) m(?: +(\d+) × +([\d.]+) %)?$", printed, re.MULTILINE
    )
    high = [row for row in rows if row[0] == "high"]
    assert len(high) == 8
    for _, sigma0, height, steps, reduction in high:
        last = f"{reduction} % ({steps} steps) |" if steps else "|"
        assert f"| {sigma0} | {height} m | {last}" in PAGE
    before, means, collocated, after = [row for row in rows if row[0] == "low"]
    assert f"| {before[2]} m | {means[2]} m | **{collocated[2]} m** |" in PAGE
    assert f"σ0 of the low one from {before[1]} to {after[1]}" in PAGE
    assert f"its height error from {before[2]} m to {after[2]} m" in PAGE
    (differ,) = re.findall(r"(\d+) % of the sub-areas differ", printed)
    assert f"differ in {differ} % of the sub-areas" in PAGE
