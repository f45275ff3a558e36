"""The first screen: where to look with links to map and tables, and the figures that most readers want."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice

from markupsafe import Markup

from tasks.document_kit.table import Number, Table
from tasks.documents.report.causes import MOST_PLACES, Cause, by_place
from tasks.documents.report.material import Material
from tasks.quantities import group_words

_OF_TRAJECTORY = ("gnss_positions", "ins_attitudes")
#: Tables in which a cause may have a row, the first one counts.
_OF_POINT = ("control-points", "check-points")
_NO_SURVEY = "no control and no check points"


@dataclass(frozen=True)
class Place:
    """A place on the first screen.

    Attributes
    ----------
    words : ``control point C004``.
    sentences : what is to be said of it.
    links : words of a link and the id it leads to.
    """

    words: str
    sentences: tuple[str, ...]
    links: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Card:
    """A figure with its words."""

    value: str
    words: str


def ring_id(found: Sequence[Cause], cause: Cause) -> str:
    """The id of the first ring around what a cause names."""
    return f"look-{list(by_place(found)).index(cause.place) + 1}"


def places(
    material: Material, found: Sequence[Cause], tables: Mapping[str, Table], block_map: Markup
) -> tuple[tuple[Place, ...], dict[str, Table]]:
    """The places of the first screen; and the tables, with an id at each row that a link leads to."""
    made, linked = [], dict(tables)
    for place, sentences in islice(by_place(found).items(), MOST_PLACES):
        first = next(cause for cause in found if cause.place == place)
        links = []
        if f'id="{ring_id(found, first)}"' in block_map:
            links.append(("map", ring_id(found, first)))
        row = _row_of(material, first, tables)
        if row is not None:
            name, key = row
            linked[name] = replace(linked[name], linked=linked[name].linked | {key})
            links.append(("table", linked[name].row_id(key)))
        made.append(Place(place, sentences, tuple(links)))
    return tuple(made), linked


def _row_of(material: Material, cause: Cause, tables: Mapping[str, Table]) -> tuple[str, str] | None:
    """The table and the key of the row that shows a cause; None without one."""
    wanted = [(name, point) for point in cause.points for name in _OF_POINT]
    if len(cause.images) == 1:
        wanted.append(("image-list", next(iter(cause.images))))
    elif cause.images:
        images = material.oriented
        strips = images["strip"][images["image"].isin(cause.images)].unique()
        if len(strips) == 1:
            name = "strip-direct-list" if cause.group in _OF_TRAJECTORY else "strip-list"
            wanted.append((name, str(strips[0])))
    for name, key in wanted:
        if any(row.key == key for row in tables[name].rows):
            return name, key
    return None


def cards(material: Material) -> tuple[Card, ...]:
    """σ0 of the whole and of the groups, RMS at check points, and the size of the block."""
    summary, figures = material.summary, material.figures
    images = summary.counts.images
    groups = [
        f"{group_words(group.group)} {Number(group.sigma0, 2)}"
        for group in figures.groups
        if group.sigma0 is not None
    ]
    return (
        Card(str(Number(summary.sigma0, 3)), "σ0 a posteriori / a priori"),
        Card(f"{Number(summary.sigma0_px, 2)} px", "σ0 of an image coordinate"),
        _independent(material),
        Card(
            f"{Number(images)}",
            f"image{'s' * (images != 1)} with {Number(summary.counts.image_points)} image points",
        ),
        *((Card("", "σ0 by group: " + ", ".join(groups)),) if len(groups) > 1 else ()),
    )


def _independent(material: Material) -> Card:
    """RMS at check points; without any, at control points, with a warning."""
    summary, free = material.summary, material.figures.free_network
    points = "check point" if summary.counts.check == 1 else "check points"
    values, what = summary.rmse_check_m, f"RMS at {summary.counts.check} {points}: east, north, up"
    if free is not None and free.defect:
        what += "; no accuracy, because the datum is not determined"
    if values is None or not summary.counts.check:
        values, what = (
            summary.rmse_control_m,
            "RMS at control points: east, north, up; there are no check points to show the accuracy",
        )
    if values is None:
        delivered = len(material.control_points)
        return Card("–", f"none of {delivered} surveyed points was used" if delivered else _NO_SURVEY)
    return Card(" ".join(str(Number(value, 3)) for value in values) + " m", what)
