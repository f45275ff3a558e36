"""The base of the models of all figures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias, cast

from pydantic import BaseModel

from tasks.files.json_text import JSON

#: A number for each axis, camera or step; null where there is none.
Values: TypeAlias = tuple[float | None, ...]


class Figure(BaseModel, frozen=True, extra="ignore"):
    """Base of the figures: immutable; figures of later versions are ignored."""

    def to_json(self) -> Mapping[str, JSON]:
        """As it is in notes and summary.json."""
        return cast(Mapping[str, JSON], self.model_dump(mode="json"))
