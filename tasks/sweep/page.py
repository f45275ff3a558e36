"""sweep.html: the scenarios of a sweep, beside a published table where the project asks for one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from tasks.report.page import TEMPLATES as REPORT_TEMPLATES
from tasks.report.provenance import SOFTWARE, versions_table
from tasks.report.table import Table
from tasks.storage.artifact import Artifact
from tasks.storage.store import stored
from tasks.sweep.image_maps import error_maps, image_maps, residual_maps
from tasks.sweep.published import PublishedTable
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
from tasks.sweep.rmse_bars import rmse_bars
from tasks.sweep.scenario import Computed
from tasks.tables.parquet import read_table

PAGE = "sweep.html"
_TEMPLATES = Path(__file__).parent / "templates"


@stored("sweep_page")
def write_sweep_page(
    folder: Path,
    *,
    table: Artifact,
    computed: tuple[Computed, ...],
    published: PublishedTable | None,
    name: str,
    software: Mapping[str, str] = SOFTWARE,
) -> None:
    """Write sweep.html.

    Parameters
    ----------
    table : sweep.parquet.
    computed : every scenario and what became of it, for the maps of the image.
    published : the table to stand beside it.
    name : of the project.
    software : versions that decide how the page looks.
    """
    ordered = read_table(table).sort_values("number", ignore_index=True)
    page = render(SweepResults(ordered, published), computed, name, versions_table(software))
    (folder / PAGE).write_text(page, encoding="utf-8")


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
        _environment()
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
    computed = "all of them are computed" if not failed else f"{failed} of them could not be computed"
    return f"{len(table)} scenarios ({varied}); {computed}."


def _counted(number: int, words: str) -> str:
    """A number with its noun in the right form."""
    first, *others = words.split()
    return " ".join([str(number), first if number == 1 else f"{first}s", *others])


@cache
def _environment() -> Environment:
    """Templates with escaping on for everything; macros and style are those of the report."""
    return Environment(
        loader=FileSystemLoader([_TEMPLATES, REPORT_TEMPLATES]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
