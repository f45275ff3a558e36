"""Errors that a user can correct, and warnings.

An :class:`InputError` ends a run with exit code 2 and one message: file, line, entity, what is
wrong, what to do. A :class:`Problem` does not end the run; it is shown first in every report.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from tasks.plain_text import visible


class AerocalError(Exception):
    """Base of the errors that are reported in one sentence and without a traceback.

    Attributes
    ----------
    stage : name of the stage that was being carried out; None: none.
    """

    stage: str | None = None

    def __reduce__(self) -> tuple[Callable[..., AerocalError], tuple[object, ...]]:
        """Return from a worker process with all attributes, however they were given."""
        return _with_attributes, (type(self), dict(vars(self)))


def _with_attributes(kind: type[AerocalError], attributes: Mapping[str, object]) -> AerocalError:
    """An error of this kind, without the constructor of an exception, which knows positions only."""
    error = kind.__new__(kind)
    vars(error).update(attributes)
    return error


@dataclass
class InputError(AerocalError):
    """The input is wrong.

    Attributes
    ----------
    what : what is wrong, a sentence.
    remedy : what to do about it, a sentence.
    file : the file it is in, None if it is not about one file.
    line : 1-based line of that file.
    entity : the image, point, camera or key concerned.
    declare : ``key = value`` in the table of the input that is read, with which it could be read; only where
        what was found leaves one such value.
    """

    what: str
    remedy: str
    file: Path | None = None
    line: int | None = None
    entity: str | None = None
    declare: str | None = None

    def __str__(self) -> str:
        place = ""
        if self.file is not None:
            file = visible(str(self.file), 1_000)
            place = f"{file}:{self.line}: " if self.line is not None else f"{file}: "
        # What it quotes was delivered by somebody: of any length, and a terminal would obey some of it.
        entity = f"{visible(self.entity, 500)}: " if self.entity else ""
        return visible(f"{place}{entity}{self.what} {self.remedy}")


@dataclass(frozen=True)
class Location:
    """Where an input is wrong; file, line and entity as of `InputError`."""

    file: Path | None
    line: int | None = None
    entity: str | None = None

    def error(self, what: str, remedy: str) -> InputError:
        """The error that something is wrong here; `what` and `remedy` as of `InputError`."""
        return InputError(what, remedy, self.file, self.line, self.entity)


@dataclass
class NotComputableError(AerocalError):
    """The adjustment cannot be computed (datum defect, divergence); exit code 3."""

    what: str

    def __str__(self) -> str:
        return self.what
