"""Values of foreign JSON files: each knows its location, which error messages state."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tasks.errors import InputError, Location
from tasks.files.json_text import from_json
from tasks.formats.plain_records import number_of

_LONGEST_SHOWN = 80


@dataclass(frozen=True)
class JsonValue:
    """A value.

    Attributes
    ----------
    file : the delivered file.
    where : names that lead to the value.
    value : as parsed.
    """

    file: Path
    where: str
    value: object

    def has(self, key: str) -> bool:
        """Whether the value is an object with this key, and a value other than null."""
        return isinstance(self.value, dict) and self.value.get(key) is not None

    def __getitem__(self, key: str) -> JsonValue:
        """The value of a key; refused where there is none."""
        if not self.has(key):
            raise self._trouble(f"There is no '{key}'.")
        assert isinstance(self.value, dict)
        return JsonValue(self.file, f"{self.where}.{key}".lstrip("."), self.value[key])

    def items(self) -> list[JsonValue]:
        """The elements of a list."""
        return list(self.each())

    def each(self) -> Iterator[JsonValue]:
        """The elements of a list, one after the other: a list of many takes no more memory."""
        if not isinstance(self.value, list):
            raise self._trouble("This is not a list.")
        for k, one in enumerate(self.value):
            yield JsonValue(self.file, f"{self.where}[{k}]", one)

    def entries(self) -> Iterator[tuple[str, JsonValue]]:
        """The keys of an object with their values, one after the other."""
        if not isinstance(self.value, dict):
            raise self._trouble("This is not an object.")
        for key, one in self.value.items():
            yield key, JsonValue(self.file, f"{self.where}.{key}".lstrip("."), one)

    def taken(self) -> Iterator[JsonValue]:
        """As `each`; the list forgets every element when the next one is required."""
        for k, one in enumerate(self.each()):
            yield one
            assert isinstance(self.value, list)
            self.value[k] = None

    def number(self) -> float:
        """A number."""
        if isinstance(self.value, bool) or not isinstance(self.value, int | float):
            raise self._trouble("This is not a number.")
        return number_of(self.file, repr(self.value), 1, self.where[-_LONGEST_SHOWN:])

    def whole(self) -> int:
        """A whole number that is not negative, such as an identifier."""
        if isinstance(self.value, bool) or not isinstance(self.value, int) or not 0 <= self.value < 2**64:
            raise self._trouble("This is not a whole number.")
        return self.value

    def numbers(self, count: int) -> list[float]:
        """A list of so many numbers."""
        found = self.items()
        if len(found) != count:
            raise self._trouble(f"There are {len(found)} numbers, but {count} are required.")
        return [one.number() for one in found]

    def text(self) -> str:
        """A text."""
        if not isinstance(self.value, str):
            raise self._trouble("This is not text.")
        return self.value

    def _trouble(self, what: str) -> InputError:
        return Location(self.file, entity=self.where[-_LONGEST_SHOWN:] or None).error(
            what, "Deliver the file again."
        )


def json_value(file: Path, content: bytes, where: str = "") -> JsonValue:
    """The value of a whole file, or of a file within a delivered one.

    Raises
    ------
    InputError
        If it is no JSON.
    """
    try:
        return JsonValue(file, where, from_json(content))
    except ValueError as error:
        raise Location(file, entity=where or None).error(
            f"This is not JSON: {error}.", "Deliver it again."
        ) from error
