"""Heads of rigs: rotation, position and synchronisation offset of each against its reference head."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy import special

from adjust.arrays import Bools, Floats
from adjust.parameters import FAMILIES
from adjust.rig import OF_HEADS, RELATIVE_POSITION, RELATIVE_ROTATION
from tasks.document_kit.row_table import number_of, table_of, text_of
from tasks.document_kit.table import Cell, Column, Row, Table, decimals_for, numbers, text_column
from tasks.documents.report.material import Material
from tasks.quantities import COMPONENTS, KINDS, Kind, entity_words, shown
from tasks.tables.covariance import Key, correlation_pairs, covariance_of, sigmas_of

#: Names of the tables of one kind each.
HEAD_TABLES = tuple(f"heads-{name}" for name in OF_HEADS)
#: Under the tables.
HEADS_NOTE = (
    "Without σ: held at the given value. Exceeded by chance: probability of as large a change of the head if "
    "the given values are right, from the joint covariance of its components. If the reference head takes no "
    "images, the rotations contain its boresight, and their σ errors common to all heads."
)
_ANGLES = {"omega": "ω", "phi": "φ", "kappa": "κ"}
_CAPTIONS = {
    RELATIVE_POSITION: "Positions of the heads relative to the reference head",
    RELATIVE_ROTATION: "Rotations of the heads relative to the reference head",
}


def has_heads(material: Material) -> bool:
    """Whether a camera of the block is a head beside another one."""
    return bool(material.camera_table["head_of"].notna().any())


def head_tables(material: Material) -> tuple[Table, ...]:
    """Relative positions, relative rotations and synchronisation offsets, one row for each head; if any."""
    if not has_heads(material):
        return ()
    return tuple(
        _kind_table(material, KINDS[kind], name) for kind, name in zip(OF_HEADS, HEAD_TABLES, strict=True)
    )


def _kind_table(material: Material, kind: Kind, name: str) -> Table:
    """Parameters of one kind; nothing for a kind that is zero for all heads."""
    table, parameters = material.camera_table, material.parameters
    heads = table.loc[table["head_of"].notna(), ["camera", "head_of"]].itertuples(index=False)
    own = parameters[parameters["parameter"].isin(_components(kind))]
    known = own.set_index(["parameter", "entity"])[["value", "change"]].to_dict("index")
    is_estimated = bool(own["sigma"].notna().any())
    shown_rows: list[Row] = []
    if is_estimated or bool((own["value"] != 0.0).any()):
        sigmas, pairs = sigmas_of(parameters), correlation_pairs(material.correlations)
        strongest = _strongest(pairs)
        for head, reference in heads:
            keys: list[Key] = [(parameter, str(head)) for parameter in _components(kind)]
            if all(key in known for key in keys):
                value, change = (np.array([known[key][part] for key in keys]) for part in ("value", "change"))
                free = np.array([key in sigmas for key in keys])
                covariance = covariance_of([k for k, f in zip(keys, free, strict=True) if f], sigmas, pairs)
                cells = _values(kind, value, free, covariance)
                if is_estimated:
                    cells += _tests(kind, change[free], covariance, _of_head(strongest, keys))
                shown_rows.append(Row(str(head), (str(head), str(reference), *cells)))
    return Table(
        name, _CAPTIONS.get(kind.name, kind.caption), _columns(kind, is_estimated), tuple(shown_rows)
    )


def _columns(kind: Kind, is_estimated: bool) -> tuple[Column, ...]:
    unit = shown(kind.unit).unit
    axes = list(kind.axes) or ["offset"]
    tests = (
        Column("change", "largest change", unit),
        Column("probability", "exceeded by chance", "%"),
        Column("correlation", "strongest correlation"),
        text_column("correlated_with", "of it with"),
    )
    return (
        text_column("head", "head"),
        text_column("reference", "relative to"),
        *(one for axis in axes for one in (Column(axis, axis, unit), Column(f"sigma_{axis}", "σ", unit))),
        *(tests if is_estimated else ()),
    )


def _values(kind: Kind, value: Floats, free: Bools, covariance: Floats) -> list[Cell]:
    """Each component with its σ; a value that is held has none."""
    _, factor, least = shown(kind.unit)
    sigma: list[float | None] = [None] * len(value)
    for place, variance in zip(np.flatnonzero(free), np.diagonal(covariance), strict=True):
        sigma[place] = factor * float(np.sqrt(variance))
    cells: list[Cell] = []
    for number, spread in zip(value * factor, sigma, strict=True):
        decimals = least if spread is None else decimals_for(spread)
        cells += numbers((float(number), spread), decimals)
    return cells


def _tests(kind: Kind, change: Floats, covariance: Floats, pair: tuple[Key, Key, float] | None) -> list[Cell]:
    """Largest change, how often chance exceeds the changes together, and the strongest correlation."""
    if not len(change):
        return [*numbers((None, None, None), 0), ""]
    factor = shown(kind.unit).factor
    largest = factor * float(change[np.argmax(np.abs(change))])
    # The probability of as large a change of a head that sits as given.
    chance = float(special.chdtrc(len(change), change @ np.linalg.solve(covariance, change)))
    decimals = decimals_for(factor * float(np.sqrt(np.diagonal(covariance).min())))
    words = ""
    if pair is not None:
        axis = COMPONENTS[pair[0][0]].direction
        words = f"{axis} with {entity_words(*pair[1])}" if axis else entity_words(*pair[1])
    return [
        *numbers((largest,), decimals, plus=True),
        *numbers((100.0 * chance,), 2),
        *numbers((None if pair is None else pair[2],), 2, plus=True),
        words,
    ]


def _components(kind: Kind) -> tuple[str, ...]:
    return tuple(FAMILIES[kind.family].components[place] for place in kind.components)


def _strongest(pairs: Mapping[tuple[Key, Key], float]) -> Mapping[Key, tuple[Key, float]]:
    """The strongest correlation of every parameter."""
    found: dict[Key, tuple[Key, float]] = {}
    for pair, value in pairs.items():
        for one, other in (pair, pair[::-1]):
            if np.isfinite(value) and (one not in found or abs(value) > abs(found[one][1])):
                found[one] = other, value
    return found


def _of_head(
    strongest: Mapping[Key, tuple[Key, float]], keys: Sequence[Key]
) -> tuple[Key, Key, float] | None:
    """The strongest correlation of a head's parameters: the parameter, the other one, and its value."""
    there = [(key, *strongest[key]) for key in keys if key in strongest]
    return max(there, key=lambda pair: abs(pair[2]), default=None)


def platform_table(material: Material) -> Table:
    """Attitudes of the heads of platforms in the axes of the virtual image (platform.parquet)."""
    shown = (
        text_of("head", "head"),
        *(
            number_of(column, heading, "°", f"sigma_{name}_deg")
            for name, letter in _ANGLES.items()
            for column, heading in ((f"{name}_deg", letter), (f"sigma_{name}_deg", "σ"))
        ),
        *(
            number_of(
                f"change_{name}_deg", f"Δ{letter}", "°", f"sigma_{name}_deg", plus=True, of=_turned(name)
            )
            for name, letter in _ANGLES.items()
        ),
        number_of("probability", "exceeded by chance", "%", 2, factor=100.0),
        number_of("correlation", "strongest correlation", decimals=2),
        text_of("correlated_with", "with head"),
    )
    note = (
        "ω, φ, κ in the axes of the virtual image, in this order of rotation; the mean rotation of all heads "
        "relative to the given attitudes is zero. Δ = calibrated − given."
    )
    caption = "Attitudes of the heads in the virtual image"
    return table_of("platform", caption, shown, material.platform, "{head}@{platform}", note)


def _turned(name: str) -> Callable[[Mapping[str, float]], float]:
    """By how much an angle of a head differs from the given one."""
    return lambda head: (head[f"{name}_deg"] - head[f"given_{name}_deg"] + 180.0) % 360.0 - 180.0
