"""Columns and tables of the contract, and the columns that several tables have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

# Units of columns by the ends of their names, the longest first.
_UNITS = {"deg_s": "deg/s", "m_s": "m/s"} | {unit: unit for unit in ("m", "mm", "um", "px", "deg", "s", "ms")}
ColumnType = Literal["string", "float64", "int32", "int64", "bool"]


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes
    ----------
    name : its name; a unit that is not fixed by the table is at its end.
    type : the Arrow type.
    unit : unit as text, empty for names and counts.
    meaning : one sentence.
    nullable : whether it may be null.
    values : the texts it may hold; empty: any.
    """

    name: str
    type: ColumnType
    unit: str
    meaning: str
    nullable: bool = False
    values: tuple[str, ...] = ()


@dataclass(frozen=True)
class TableSchema:
    """One table of the contract.

    Attributes
    ----------
    name : the artifact's name.
    meaning : what a row is.
    columns : in their order.
    key : columns that identify a row, and the sort order.
    coordinates : columns that are x, y, z in the table's CRS and become its geometry; empty: none.
    version : raised when a column changes its meaning.
    """

    name: str
    meaning: str
    columns: tuple[Column, ...]
    key: tuple[str, ...]
    coordinates: tuple[str, ...] = ()
    version: int = 1

    def column(self, name: str) -> Column:
        """The column of this name.

        Raises
        ------
        KeyError
            If there is none.
        """
        for column in self.columns:
            if column.name == name:
                return column
        raise KeyError(name)


def text(name: str, meaning: str, *, nullable: bool = False, values: tuple[str, ...] = ()) -> Column:
    """A column of texts, of certain ones only if ``values`` are given."""
    return Column(name, "string", "", meaning, nullable, values)


def number(name: str, meaning: str, unit: str | None = None, *, nullable: bool = False) -> Column:
    """A column of numbers, in the unit at the end of its name unless another one is given."""
    own = next((own for end, own in _UNITS.items() if name.endswith(f"_{end}")), "")
    return Column(name, "float64", own if unit is None else unit, meaning, nullable)


def count(name: str, meaning: str, *, nullable: bool = False) -> Column:
    """A column of counts."""
    return Column(name, "int32", "", meaning, nullable)


def flag(name: str, meaning: str) -> Column:
    """A column of yes and no."""
    return Column(name, "bool", "", meaning)


def position(of: str, *, nullable: bool = False) -> tuple[Column, ...]:
    """Columns x, y, z in metres, in the table's CRS."""
    directions = (("x", "east"), ("y", "north"), ("z", "height"))
    return tuple(
        number(f"{axis}_m", f"{of}: {way} in the table's CRS", nullable=nullable) for axis, way in directions
    )


def sigmas(names: tuple[str, ...], unit: str, *, nullable: bool = False) -> tuple[Column, ...]:
    """Columns with the standard deviations of quantities in one unit."""
    return tuple(
        number(f"sigma_{name}_{unit}", f"standard deviation of {name}_{unit}", unit, nullable=nullable)
        for name in names
    )


XYZ = ("x", "y", "z")

XYZ_M = ("x_m", "y_m", "z_m")

IMAGE = text("image", "image name, verbatim")

POINT = text("point", "point name, verbatim")
OTHER_POINT = text("other_point", "name of the object point at its other end")

CAMERA = text("camera", "camera name of the project file")

STRIP = text("strip", "strip, null if not known", nullable=True)

FLIGHT = text("flight", "flight, null if not known", nullable=True)

OPK = tuple(
    number(f"{name}_deg", f"{name} of R = R_x(ω) R_y(φ) R_z(κ), grid axes of the CRS from camera")
    for name in ("omega", "phi", "kappa")
)

OPTIONAL_ANGLES = tuple(
    number(f"{name}_deg", meaning, nullable=True)
    for name, meaning in (
        (
            "omega",
            "ω of R = R_x(ω) R_y(φ) R_z(κ), grid axes of the CRS from camera; null if the input is heading",
        ),
        ("phi", "φ of the same"),
        ("kappa", "κ of the same"),
        ("heading", "heading of the body, clockwise from true north; null if the input is ω, φ, κ"),
        ("pitch", "pitch of the body, nose up positive"),
        ("roll", "roll of the body, right wing down positive"),
    )
)
