"""Published tables, kept as data with their source, shown next to a sweep that requests one of them.

Each is a file in ``published/``. Its rows have the block, control and variant of the scenario they are about,
and numbers under the names and in the units of sweep.parquet. They are shown, and never enter a computation.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cached_property
from importlib import resources
from importlib.resources.abc import Traversable

from pydantic import BaseModel, model_validator

from tasks.files.json_text import JSON

Scenario = tuple[str, str, str]


class PublishedPart(BaseModel, frozen=True, extra="forbid"):
    """One printed table.

    Attributes
    ----------
    title : what it shows.
    control : the choice of control points of every row; None if the rows name it.
    columns : names of the columns; the first ones say which scenario a row is about.
    rows : their values; an empty text is a number that is not printed.
    """

    title: str
    control: str | None = None
    columns: tuple[str, ...]
    rows: tuple[tuple[str | float, ...], ...]

    @model_validator(mode="after")
    def _rows_fit_columns(self) -> PublishedPart:
        if any(len(row) != len(self.columns) for row in self.rows):
            raise ValueError(f"a row of '{self.title}' does not fit its columns")
        return self

    def figures(self) -> dict[Scenario, dict[str, float]]:
        """The numbers of every scenario by name."""
        found: dict[Scenario, dict[str, float]] = {}
        for row in self.rows:
            named = dict(zip(self.columns, row, strict=True))
            control = self.control if self.control is not None else named.pop("control")
            scenario = (str(named.pop("block")), str(control), str(named.pop("variant")))
            found[scenario] = {name: float(value) for name, value in named.items() if value != ""}
        return found


class PublishedTable(BaseModel, frozen=True, extra="forbid"):
    """What a publication prints about scenarios like those of a sweep.

    Attributes
    ----------
    name : of the data file.
    title, source : what it is, and where it was printed.
    remarks : what has to be known to read it.
    parts : the printed tables.
    facts, statistics : of a burn-in protocol: single figures, and rows of three by the keys of our tables.
    heads : omega, phi, kappa of each head of its platform, degrees.
    """

    name: str
    title: str
    source: str
    remarks: tuple[str, ...] = ()
    parts: tuple[PublishedPart, ...]
    facts: dict[str, float] = {}
    statistics: dict[str, tuple[float, float, float]] = {}
    heads: dict[str, tuple[float, float, float]] = {}

    @cached_property
    def figures(self) -> Mapping[Scenario, Mapping[str, float]]:
        """The numbers of every scenario (block, control, variant) of all parts, by name."""
        found: dict[Scenario, dict[str, float]] = {}
        for part in self.parts:
            for scenario, figures in part.figures().items():
                found.setdefault(scenario, {}).update(figures)
        return found

    def key_content(self) -> JSON:
        """Everything that is printed, for the key of the stage that shows it."""
        content: JSON = self.model_dump(mode="json")
        return content

    def input_files(self) -> tuple[()]:
        """No delivered file: the tables are a part of the program."""
        return ()


def published_names() -> tuple[str, ...]:
    """Names of the published tables, in alphabetical order."""
    files = (entry.name for entry in _folder().iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in files if name.endswith(".toml")))


def published_protocols() -> tuple[str, ...]:
    """Names of those that contain the statistics of a burn-in protocol."""
    return tuple(name for name in published_names() if published_table(name).statistics)


def published_table(name: str) -> PublishedTable:
    """A published table by its name.

    Raises
    ------
    FileNotFoundError
        If there is none.
    """
    text = (_folder() / f"{name}.toml").read_text(encoding="utf-8")
    return PublishedTable.model_validate({"name": name, **tomllib.loads(text)})


def _folder() -> Traversable:
    return resources.files("tasks.settings") / "published"
