"""Rows from several files: the place each came from, the checks that need it, and further columns.

Further columns of input files are kept as text and reported.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from tasks.errors import InputError
from tasks.formats.records import ControlRecords, DistanceRecords, ExposureRecords, ImagePointRecords, Lines


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """File and line of every row of one or several files.

    Attributes
    ----------
    files : the files.
    file : (n,) number of the file of each row.
    line : (n,) 1-based line in it.
    """

    files: tuple[Path, ...]
    file: NDArray[np.int32]
    line: Lines

    @classmethod
    def of_files(cls, files: Sequence[Path], lines: Sequence[Lines]) -> Places:
        """The places of rows that are read file after file."""
        numbers = [np.full(len(line), number, dtype=np.int32) for number, line in enumerate(lines)]
        return cls(
            tuple(files),
            np.concatenate([np.zeros(0, np.int32), *numbers]),
            np.concatenate([np.zeros(0, np.int64), *lines]),
        )

    def error(self, row: int, what: str, remedy: str, entity: str | None = None) -> InputError:
        """An error at the place of a row."""
        return InputError(what, remedy, self.files[int(self.file[row])], int(self.line[row]), entity)

    def refuse(
        self, wrong: NDArray[np.bool_], names: Sequence[object], what: str | Callable[[int], str], remedy: str
    ) -> None:
        """Raise if a row (n,) is wrong.

        Parameters
        ----------
        names : (n,) of what the rows are about.
        what : what is wrong; a function where it depends on the row.

        Raises
        ------
        InputError
            Naming the first row.
        """
        if wrong.any():
            row = int(np.argmax(wrong))
            raise self.error(row, what if isinstance(what, str) else what(row), remedy, str(names[row]))

    def refuse_duplicates(self, codes: NDArray[np.int64], kind: str, names: Sequence[Sequence[str]]) -> None:
        """Raise if two rows have the same code.

        Parameters
        ----------
        codes : (n,) number that identifies the entity of each row.
        kind : what a row is, for the message.
        names : for each part of the name, the names (n,) or anything indexable by row.

        Raises
        ------
        InputError
            Naming the lines of the first two rows that are the same.
        """
        # Looked for where equal codes stand side by side, which takes a fifth of the memory of a look-up.
        ordered = np.sort(codes)
        if not (ordered[1:] == ordered[:-1]).any():
            return
        again = pd.Series(codes).duplicated().to_numpy()
        second = int(np.argmax(again))
        first = int(np.argmax(codes == codes[second]))
        entity = " in ".join(f"'{part[second]}'" for part in names)
        other = self.files[int(self.file[first])] if self.file[first] != self.file[second] else None
        what, remedy = given_twice(kind, int(self.line[first]), other, int(again.sum()) - 1)
        raise self.error(second, what, remedy, entity)


def given_twice(kind: str, line: int, other: Path | None, more: int) -> tuple[str, str]:
    """A sentence that an entity is also given in another line, how many more are, and the remedy."""
    place = f"line {line}" + (f" of {other}" if other is not None else "")
    count = f" ({more} more like this)" if more else ""
    return f"This {kind} was already given in {place}{count}.", "Delete one of the two rows."


@dataclass(frozen=True, slots=True)
class SigmaRange:
    """Standard deviations that a quantity can have, in the unit of the file.

    Attributes
    ----------
    lowest, highest : what no measurement falls short of, and what says nothing any more.
    unit : of both, for messages.
    """

    lowest: float
    highest: float
    unit: str


#: Of coordinates on the ground: a micrometre, and further than any point is from another.
METRES = SigmaRange(1e-6, 1e5, "m")


def refuse_sigmas(
    places: Places, sigma: NDArray[np.float64], row_names: Sequence[str], allowed: SigmaRange
) -> None:
    """Raise if a given standard deviation (n, k) is not positive or beyond all there is; NaN is not given.

    Raises
    ------
    InputError
        Naming the row.
    """
    bad = (sigma < allowed.lowest) | (sigma > allowed.highest)
    if bad.any():
        row = int(np.argmax(bad.any(axis=1)))
        value = float(sigma[row, np.argmax(bad[row])])
        beyond = f": {allowed.lowest:g} to {allowed.highest:g} {allowed.unit} are possible"
        raise places.error(
            row,
            f"The standard deviation {value:g} cannot be{beyond if value > 0.0 else ''}.",
            "Give a positive value in the unit of the file, or leave the field empty to use that of the "
            "input.",
            str(row_names[row]),
        )


def about_missing_sigmas(
    file: Path, sigma: NDArray[np.float64], known: NDArray[np.bool_], default: str
) -> tuple[str, ...]:
    """A sentence if some rows give standard deviations and others leave them to the input.

    Parameters
    ----------
    sigma : (n, k) as given, NaN where not.
    known : (n, k) whether there is a quantity at all.
    default : what applies to the others, in words.
    """
    without = int((np.isnan(sigma) & known).any(axis=1).sum())
    given = bool(np.isfinite(sigma).any())
    return (sigmas_missing(file, without, len(sigma), default),) if without and given else ()


def sigmas_missing(file: Path, without: int, rows: int, default: str) -> str:
    """The sentence of :func:`about_missing_sigmas` about so many of all rows."""
    which = (
        "no row has all of its standard deviations"
        if without == rows
        else f"{without:,} of {rows:,} rows have no standard deviation although others do"
    )
    return (
        f"{file.name}: {which}; {default} of the project file is used for what is missing. "
        "Fill it in if this is not intended."
    )


def joined(extras: Sequence[Mapping[str, pa.Array]], rows: Sequence[int]) -> dict[str, pa.Array]:
    """One column for each name, file after file; null where a file does not have it."""
    names = dict.fromkeys(name for extra in extras for name in extra)
    return {
        name: pa.concat_arrays(
            [extra.get(name, pa.nulls(count, pa.string())) for extra, count in zip(extras, rows, strict=True)]
        )
        for name in names
    }


def about_extra(
    records: Sequence[ImagePointRecords | ExposureRecords | ControlRecords | DistanceRecords],
) -> Iterator[str]:
    """A sentence for each file with further columns."""
    for record in records:
        if record.extra:
            yield f"{record.file.name}: kept as text, and not used: {', '.join(record.extra)}."
