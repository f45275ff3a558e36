"""Settings of a sweep: which scenarios of one project are computed side by side.

A scenario is a sub-block, a choice of control points and a variant of the settings; a sweep computes every
combination of the three.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field, JsonValue, model_validator

from tasks.settings.base import Settings, one_of, trouble
from tasks.settings.coordinates import NotNegativePair, Whole
from tasks.settings.published_sweep import published_names

Name = Annotated[str, Field(min_length=1)]

#: The setting that ``parameters`` varies.
SELECTION = "adjustment.self_calibration.parameters"
#: The only variant of a sweep that varies no settings.
UNCHANGED = "as in the project"


class BlockSelection(Settings):
    """Images of a sub-block: those that meet all given conditions; `["low"]` is short for these flights."""

    flights: tuple[str, ...] | None = None
    """Names of the flights; default: all."""
    strips: tuple[str, ...] | None = None
    """Names of the strips, with `*` and `?` as wildcards: `["E*"]` excludes crossing strips, `["E01", "E03",
    "E05"]` reduces double coverage to single. Default: all.
    """
    height_m: NotNegativePair | None = None
    """Minimum and maximum flying height above the object points, m; default: any."""

    every_strip: Annotated[Whole, Field(ge=1)] = 1
    """Only every p-th of these strips of each flight, in the order of their names. With 60 % side lap, 2
    leaves 20 %.
    """
    every_image: Annotated[Whole, Field(ge=1)] = 1
    """Only every q-th image of each strip, in the order of their names: with 80 % end lap, 2 leaves 60 %."""

    @model_validator(mode="before")
    @classmethod
    def _from_list(cls, value: object) -> object:
        if value == "all":
            return {}
        return {"flights": value} if isinstance(value, list | tuple) else value


class ControlScenario(Settings):
    """Which surveyed points are control points; all others are check points."""

    roles: Literal["delivered", "all"] | None = None
    """`"delivered"`: as in the control files; `"all"`: every point. Written as this word alone."""
    count: Annotated[Whole, Field(ge=0)] | None = None
    """Number of control points, chosen from those that are surveyed in all coordinates and measured."""
    layout: Literal["even", "border"] = "even"
    """How `count` points are chosen. `even`: each as far as possible from the preceding ones, so that the
    first four lie in the corners and smaller selections are subsets of larger ones; `border`: evenly along
    the border of the area.
    """
    points: tuple[str, ...] | None = None
    """Exactly these points; a list alone is short for it."""

    @model_validator(mode="before")
    @classmethod
    def _from_word_or_list(cls, value: object) -> object:
        if isinstance(value, str):
            return {"roles": value}
        return {"points": value} if isinstance(value, list | tuple) else value

    @model_validator(mode="after")
    def _one_choice(self) -> ControlScenario:
        if [self.roles, self.count, self.points].count(None) != 2:
            raise trouble(
                "The choice of control points is not valid.",
                'Write "all", "delivered", { count = 44 }, or a list of points.',
            )
        return self


class SweepSettings(Settings):
    """Scenarios for comparison; `aerocal sweep` computes every combination."""

    outside_key: ClassVar[frozenset[str]] = frozenset({"workers"})

    blocks: dict[Name, BlockSelection] = Field(default={"all": BlockSelection()}, min_length=1)
    """Sub-blocks by name, e.g. `both = ["low", "high"]` (flights) or a table. Default: the whole block."""
    control: dict[Name, ControlScenario] = Field(
        default={"delivered": ControlScenario(roles="delivered")}, min_length=1
    )
    """Choices of control points by name, e.g. `"44/40" = { count = 44 }`. Default: the roles as delivered."""
    parameters: tuple[Name, ...] = Field(
        default=(),
        description="Sets of additional parameters, each giving a variant of this name; short for variants "
        f'that change `{SELECTION}`, e.g. `["none", "bluh:1-12"]`.',
    )
    variants: dict[Name, dict[str, JsonValue]] = Field(default={})
    """Variants of the settings by name; each lists the settings of this file that it changes: `loose = {
    "inputs.control.sigma_m" = 0.1 }`. An empty table changes nothing.
    """
    compare_with: Annotated[str, AfterValidator(one_of(published_names, "published table"))] | None = None
    """Published table shown with the results where block, control and variant have the same names
    (docs/sweep.md).
    """
    workers: Annotated[Whole, Field(ge=1)] | None = None
    """Number of parallel processes; it does not affect the results. Default: one for each processor."""

    @model_validator(mode="after")
    def _every_name_once(self) -> SweepSettings:
        names = [*self.parameters, *self.variants]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise trouble(f"There are two variants '{twice}'.", "Give each of them its own name.")
        return self

    def changes(self) -> Mapping[str, Mapping[str, JsonValue]]:
        """Every variant by name: dotted keys of the project file and their values."""
        of_sets: dict[str, Mapping[str, JsonValue]] = {name: {SELECTION: name} for name in self.parameters}
        others = {name: dict(_flat("", variant)) for name, variant in self.variants.items()}
        return {**of_sets, **others} or {UNCHANGED: {}}


def _flat(prefix: str, table: Mapping[str, JsonValue]) -> Iterator[tuple[str, JsonValue]]:
    """Leaves of nested tables as (dotted key, value)."""
    for key, value in table.items():
        if isinstance(value, dict) and value:
            yield from _flat(f"{prefix}{key}.", value)
        else:
            yield f"{prefix}{key}", value
