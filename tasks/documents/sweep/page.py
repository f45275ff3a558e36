"""sweep.html: the scenarios of a sweep, next to a published table if the project requests one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from tasks.document_kit.table import Table
from tasks.document_kit.templates import templates
from tasks.documents.report.page import TEMPLATES as REPORT_TEMPLATES
from tasks.documents.sweep.image_maps import error_maps, image_maps, residual_maps
from tasks.documents.sweep.rmse_bars import rmse_bars
from tasks.sweep.result_tables import (
    ROLES,
    SweepResults,
    block_table,
    failure_table,
    gsd_table,
    has_points,
    largest_table,
    residual_table,
    rms_table,
    variant_table,
)
from tasks.sweep.scenario import Computed

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
    page: str = (
        templates(_TEMPLATES, REPORT_TEMPLATES)
        .get_template("sweep.html.j2")
        .render(
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
    )
    return page


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
    return f"{len(table)} scenarios ({varied}); {computed}."


def _counted(number: int, words: str) -> str:
    """A number with its noun in the right form."""
    first, *others = words.split()
    return " ".join([str(number), first if number == 1 else f"{first}s", *others])
