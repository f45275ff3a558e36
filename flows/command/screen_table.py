"""Tables on the screen: a rule below the header and no frame, for eighty columns; numbers at the right."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

#: Narrower, the columns of numbers would be cut.
_LEAST_WIDTH = 80


def screen(*, stderr: bool = False) -> Console:
    """The screen, at least eighty columns wide; a narrower one wraps the lines itself."""
    console = Console(stderr=stderr)
    console.width = max(console.width, _LEAST_WIDTH)
    return console


def screen_table(
    *columns: str, right: Collection[str] = (), whole: Collection[str] = (), title: str = ""
) -> Table:
    """An empty table.

    Parameters
    ----------
    columns : headings.
    right : those of numbers, which stand at the right and are never wrapped.
    whole : those of texts that are never wrapped.
    """
    table = Table(
        title=title or None,
        title_justify="left",
        title_style="bold",
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
    )
    for column in columns:
        numeric = column in right
        # As Text, for a unit in brackets would be taken for a style.
        table.add_column(
            Text(column),
            justify="right" if numeric else "left",
            no_wrap=numeric or column in whole,
            overflow="fold",
        )
    return table


def facts_table(rows: Iterable[tuple[str, str]]) -> Table:
    """Names and their values, without header and frame."""
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, value in rows:
        table.add_row(name, value)
    return table


def print_listed(
    console: Console, sentences: Iterable[object], style: str = "", *, wrap: bool = True
) -> None:
    """Print sentences one below the other; `wrap`: in lines as long as the screen is wide."""
    for sentence in sentences:
        console.print(Text(f"• {sentence}", style=style), soft_wrap=not wrap)


def figure(value: float | None, decimals: int) -> str:
    """A number; a dash where there is none."""
    return "–" if value is None else f"{value:,.{decimals}f}"
