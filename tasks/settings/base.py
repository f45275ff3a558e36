"""The base of all settings, and paths to input files inside them.

A settings model says two things to the stage store: its values, and which bytes stand behind the
paths in it. Hence :meth:`Settings.key_content`: a path is replaced by the digest of the file it points
to. Moving a delivery to another folder changes nothing, changing one byte of it does.
"""

from __future__ import annotations

import ast
import inspect
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import date
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, ClassVar, TypeAlias, get_args

from pydantic import BaseModel, BeforeValidator, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from adjust.errors import ExtensionError
from adjust.extensions import Extended
from tasks.errors import InputError, Location
from tasks.files.delivered_file import digest_for_key, is_there, lies_under, read_delivered, trouble_of
from tasks.files.json_text import JSON
from tasks.nearest_name import did_you_mean
from tasks.plain_text import quoted, visible

_VARIABLE = re.compile(r"\$\{([A-Za-z_][A-Za-z0-9_]*)\}")

#: The variable of the public test data; ``--data DIR`` replaces it when it is not set.
DATA_VARIABLE = "AEROCAL_TEST_DATA"
_SHOWN = 500


class Settings(BaseModel, frozen=True, extra="forbid"):
    """Base of every table of the project file: immutable, and an unknown key is an error.

    The docstring of a key is its meaning in messages and pages, see :func:`meaning_of`.
    """

    #: Fields that no stage reads (names for people) and that therefore must not cause recomputing.
    outside_key: ClassVar[frozenset[str]] = frozenset()

    @field_validator("*", mode="before")
    @classmethod
    def _truth_is_no_number(cls, value: object, info: ValidationInfo) -> object:
        # In Python true is 1, so a version, an angle or a count could be true.
        kind = cls.model_fields[str(info.field_name)].annotation
        if isinstance(value, bool) and not _may_be_truth(kind):
            raise trouble(f"The value {str(value).lower()} is not allowed here.", "Give a number or a text.")
        return value

    def key_content(self) -> JSON:
        """Content that identifies these settings, with file digests in the place of paths.

        Raises
        ------
        InputError
            If a file that a path points to does not exist.
        """
        names = (name for name in type(self).model_fields if name not in self.outside_key)
        return {name: _key_content(getattr(self, name)) for name in names}

    def input_files(self) -> tuple[Path, ...]:
        """Every input file these settings point to, in the order of the fields."""
        return tuple(_paths_in([getattr(self, name) for name in type(self).model_fields]))


def meaning_of(model: type[Settings], key: str) -> str:
    """The description of a key: of its field where it is computed, otherwise its docstring.

    Docstrings are read when a message or a page needs one; pydantic would read those of all models at every
    start (``use_attribute_docstrings``, 0.2 s).
    """
    described = model.model_fields[key].description
    owner = next(one for one in model.__mro__ if key in inspect.get_annotations(one))
    return described or _docstrings_of(owner).get(key, "")


@cache
def _docstrings_of(model: type) -> dict[str, str]:
    (definition,) = ast.parse(inspect.getsource(model)).body
    meanings = {}
    for field_, behind in pairwise(definition.body if isinstance(definition, ast.ClassDef) else ()):
        match field_, behind:
            case ast.AnnAssign(target=ast.Name(id=key)), ast.Expr(value=ast.Constant(value=str(text))):
                meanings[key] = " ".join(text.split())
    return meanings


def _may_be_truth(kind: object) -> bool:
    return kind is bool or any(map(_may_be_truth, get_args(kind)))


def _key_content(value: object) -> JSON:
    if isinstance(value, Settings):
        return value.key_content()
    if isinstance(value, Path):
        return {"sha256": digest_for_key(existing(value))}
    if isinstance(value, Mapping):
        return {str(key): _key_content(item) for key, item in sorted(value.items())}
    if isinstance(value, list | tuple):
        return [_key_content(item) for item in value]
    if isinstance(value, date):
        return value.isoformat()
    if value is None or isinstance(value, str | int | float | bool):
        return value
    raise TypeError(f"{type(value).__name__} cannot be used in settings: it has no content for a key")


def _paths_in(values: Iterable[object]) -> Iterator[Path]:
    for value in values:
        if isinstance(value, Settings):
            yield from value.input_files()
        elif isinstance(value, Path):
            yield value
        elif isinstance(value, Mapping):
            yield from _paths_in(value.values())
        elif isinstance(value, list | tuple):
            yield from _paths_in(value)


def existing(path: Path) -> Path:
    """The path itself, if there is a file.

    Raises
    ------
    InputError
        If there is none.
    """
    if not is_there(path):
        raise Location(path).error("This input file does not exist.", "Check the path in the project file.")
    return path


@dataclass(frozen=True)
class PathContext:
    """How paths in a project file are read.

    Attributes
    ----------
    folder : the project file's folder; relative paths start here.
    data : a second folder in which relative paths are looked up (``--data``).
    environment : the variables ``${NAME}`` may use.
    roots : folders every resolved path must lie under (runs of a deployment); empty: anywhere.
    """

    folder: Path
    data: Path | None = None
    environment: Mapping[str, str] = field(default_factory=lambda: dict(os.environ))
    roots: tuple[Path, ...] = ()

    def resolve(self, text: str) -> Path:
        """The absolute path of an existing input file.

        Raises
        ------
        PydanticCustomError
            Naming the variable that is not set, the file that does not exist or the root it is not under.
        """
        path = Path(_VARIABLE.sub(self._value_of, text))
        if not self.roots:
            # The home folder of the server's user is nobody's business.
            path = _expanded(path)
        candidates = [self.folder / path]
        if self.data is not None:
            candidates.append(self.data / path)
        # Whether there is something outside the roots is not told either.
        allowed = [candidate for candidate in candidates if self._may_be_read(candidate)]
        if not allowed:
            raise trouble(
                f"The file {candidates[0]} is not in a folder that this deployment may read.",
                "Move it to one of: " + ", ".join(map(str, self.roots)) + ".",
            )
        found = next((candidate for candidate in allowed if is_there(candidate)), None)
        if found is None:
            places = " nor ".join(visible(str(candidate), _SHOWN) for candidate in candidates)
            raise trouble(f"There is no file {places}.", "Correct the path, or copy the file there.")
        wrong = trouble_of(found.resolve())
        if wrong is not None:
            raise trouble(f"{wrong.file}: {wrong.what}", wrong.remedy)
        return found.resolve()

    def _may_be_read(self, path: Path) -> bool:
        """Whether a path, all links resolved, lies under one of the roots, if there are any."""
        return not self.roots or lies_under(path, [root.resolve() for root in self.roots])

    def _value_of(self, match: re.Match[str]) -> str:
        name = match.group(1)
        value = self.environment.get(name)
        if value is None and name == DATA_VARIABLE and self.data is not None:
            return str(self.data.resolve())
        if value is None:
            raise trouble(
                f"The environment variable {name} is not set.", f"Set it, e.g. `export {name}=/path/to/data`."
            )
        return value


def _expanded(path: Path) -> Path:
    try:
        return path.expanduser()
    except RuntimeError as error:
        raise trouble(f"There is no user '{path.parts[0]}'.", "Correct the path.") from error


def variables_in(file: Path) -> frozenset[str]:
    """Names of the variables ``${NAME}`` that a project file may use; none if it cannot be read."""
    try:
        return frozenset(_VARIABLE.findall(read_delivered(file.resolve(), "settings").decode("utf-8")))
    except (InputError, ValueError):
        return frozenset()


def trouble(what: str, remedy: str) -> PydanticCustomError:
    """A validation error that carries what is wrong and what to do (see ``settings.load``)."""
    return PydanticCustomError("aerocal", "{what} {remedy}", {"what": what, "remedy": remedy})


def one_of(known: Collection[str] | Callable[[], Collection[str]], kind: str) -> Callable[[str], str]:
    """A check that a text is one of the names in a register; `kind` is what the names denote.

    What an extension adds is loaded, so that one that cannot be used is refused here.
    """

    def check(name: str) -> str:
        names = known() if callable(known) else known
        try:
            if name not in names:
                raise trouble(f"There is no {kind} {quoted(name)}.", did_you_mean(name, list(names)))
            if isinstance(names, Extended):
                names[name]
        except ExtensionError as error:
            raise trouble(str(error), "Repair that package, or use another one.") from error
        return name

    return check


def _resolve(value: object, info: ValidationInfo) -> Path:
    if isinstance(value, Path):
        return value
    if not isinstance(value, str) or not value.strip():
        raise trouble("A path is expected here, in quotes.", "Give the path of a file.")
    context = info.context if isinstance(info.context, PathContext) else PathContext(Path.cwd())
    return context.resolve(value)


#: The path of an input file: relative to the project file, with ``${NAME}`` from the environment.
InputPath: TypeAlias = Annotated[Path, BeforeValidator(_resolve)]


def _one_or_several(value: object) -> object:
    return (value,) if isinstance(value, str) else value


#: Paths; a single one stands for a list with one.
InputPaths: TypeAlias = Annotated[tuple[InputPath, ...], BeforeValidator(_one_or_several)]
