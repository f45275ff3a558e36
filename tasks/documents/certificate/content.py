"""The content of a certificate, independent of HTML, PDF or JSON: sections of text, tables and drawings.

The three documents are made from this one tree, so their numbers cannot differ. Numbers carry their full
value besides the digits that are shown (`tasks.document_kit.table.Number`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

from markupsafe import Markup

from tasks.calibration.record import Verdict
from tasks.document_kit.table import Cell, Table

#: Letters of the verification code that are printed in the head of every page.
_GROUPS, _LETTERS = 4, 4


@dataclass(frozen=True)
class Words:
    """A paragraph; ``note`` is printed small."""

    text: str
    tone: Literal["plain", "note"] = "plain"


@dataclass(frozen=True)
class Sentences:
    """Sentences below each other, with a heading; there is at least one."""

    heading: str
    items: tuple[str, ...]


@dataclass(frozen=True)
class Fact:
    """One line of a list of facts.

    Attributes
    ----------
    key : for programs.
    label : for people.
    values : numbers or texts, printed with ``joint`` between them; none: a line to be filled in by hand.
    unit : after the last value; empty for texts and counts.
    """

    key: str
    label: str
    values: tuple[Cell, ...]
    unit: str = ""
    joint: str = ", "

    @property
    def shown(self) -> str:
        """The values as they are printed."""
        return f"{self.joint.join(str(value) for value in self.values)}{self.gap}{self.unit}"

    @property
    def gap(self) -> str:
        """The separator before the unit."""
        return "" if self.unit in ("", "°") else " "


@dataclass(frozen=True)
class Facts:
    """Facts below each other, with a heading that may be empty."""

    name: str
    heading: str
    facts: tuple[Fact, ...]


@dataclass(frozen=True)
class Listing:
    """A table.

    Attributes
    ----------
    table : with its caption and note.
    wide : names of the columns of texts that share the room the others leave.
    """

    table: Table
    wide: tuple[str, ...] = ()


@dataclass(frozen=True)
class Coefficient:
    """A cell of a matrix of correlations: the coefficient, its ground, and whether it is printed white."""

    value: float
    shown: str
    colour: str
    inverse: bool


@dataclass(frozen=True)
class CorrelationMatrix:
    """The triangle under the diagonal of a matrix of correlations; row i has i coefficients."""

    name: str
    caption: str
    labels: tuple[str, ...]
    rows: tuple[tuple[Coefficient, ...], ...]
    note: str = ""


@dataclass(frozen=True)
class Figure:
    """A drawing.

    Attributes
    ----------
    name, caption : for programs and for people.
    alternative : what it shows, in words.
    drawing : SVG.
    width : of the room between the margins, 1 for all of it.
    """

    name: str
    caption: str
    alternative: str
    drawing: Markup
    width: float = 1.0


@dataclass(frozen=True)
class SideBySide:
    """Two narrow tables or drawings side by side."""

    blocks: tuple[Listing | Figure, ...]


@dataclass(frozen=True)
class Signature:
    """A place for a signature by hand.

    Attributes
    ----------
    role : what is signed as, under the line.
    name : printed with it; empty where nobody is named.
    filled : printed on the line; empty: to be written by hand.
    """

    role: str
    name: str = ""
    filled: str = ""


@dataclass(frozen=True)
class Signatures:
    """Places for signatures side by side."""

    places: tuple[Signature, ...]


Block: TypeAlias = Words | Sentences | Facts | Listing | CorrelationMatrix | Figure | SideBySide | Signatures


@dataclass(frozen=True)
class Section:
    """A numbered section with its name and its heading."""

    name: str
    heading: str
    blocks: tuple[Block, ...]

    @property
    def single_blocks(self) -> tuple[Block, ...]:
        """Its blocks one after the other, including those shown side by side."""
        return tuple(
            one
            for block in self.blocks
            for one in (block.blocks if isinstance(block, SideBySide) else (block,))
        )


#: What is certified.
Kind: TypeAlias = Literal["geometric", "radiometric", "burn_in"]
_TITLES: Mapping[Verdict, str] = {
    "accepted": "Calibration certificate",
    "restricted": "Calibration certificate with restrictions",
    "refused": "Calibration not accepted",
}
_BURN_IN_TITLES: Mapping[Verdict, str] = {
    "accepted": "Burn-in protocol",
    "restricted": "Burn-in protocol with restrictions",
    "refused": "Burn-in protocol: limits not met",
}
_RADIOMETRIC_TITLES: Mapping[Verdict, str] = {
    "accepted": "Radiometric certificate",
    "restricted": "Radiometric certificate with restrictions",
    "refused": "Radiometric limits not met",
}


_OF_KIND: Mapping[Kind, Mapping[Verdict, str]] = {
    "geometric": _TITLES,
    "radiometric": _RADIOMETRIC_TITLES,
    "burn_in": _BURN_IN_TITLES,
}


@dataclass(frozen=True)
class CertificateContent:
    """A certificate.

    Attributes
    ----------
    camera : what it is about, in the head of every page.
    project : the calibration flight's project.
    verdict : of the record.
    sentence : the verdict in words.
    code : sha256 of the record.
    sections : in their order.
    kind : of what is certified; decides the title and what is under it.
    file : name of the documents, without their endings.
    """

    camera: str
    project: str
    verdict: Verdict
    sentence: str
    code: str
    sections: tuple[Section, ...]
    kind: Kind = "geometric"
    file: str = "certificate"

    @property
    def title(self) -> str:
        """Title of the document; that of a refused calibration is no certificate."""
        return _OF_KIND[self.kind][self.verdict]

    @property
    def subject(self) -> str:
        """Its subject, below the camera."""
        if self.kind == "geometric":
            return f"System calibration of an aerial camera · flight {self.project}"
        if self.kind == "burn_in":
            return f"Platform calibration and triangulation of the burn-in flight {self.project}"
        return f"Radiometric examination of an aerial camera · {self.project}"

    @property
    def short_code(self) -> str:
        """The first letters of the code, in groups."""
        return short_code(self.code)

    @property
    def figures(self) -> tuple[Figure, ...]:
        """All drawings in their order."""
        return tuple(b for section in self.sections for b in section.single_blocks if isinstance(b, Figure))


def short_code(digest: str) -> str:
    """The first letters of a digest in groups that can be read aloud: ``3F9A-…``."""
    letters = digest[: _GROUPS * _LETTERS].upper()
    return "-".join(letters[at : at + _LETTERS] for at in range(0, len(letters), _LETTERS))


def beside(*blocks: Listing | Figure | None) -> tuple[Block, ...]:
    """Two blocks side by side, or the only one."""
    there = tuple(block for block in blocks if block is not None)
    return (SideBySide(there),) if len(there) > 1 else there
