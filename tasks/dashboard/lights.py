"""Traffic lights that can be read without their colour: each has its words beside it."""

from __future__ import annotations

from typing import Literal, TypeAlias

Light: TypeAlias = Literal["good", "attention", "bad"]

_SIGNS = {"good": "🟢", "attention": "🟡", "bad": "🔴"}
#: From the gravest on.
GRAVITY: tuple[Light, ...] = ("bad", "attention", "good")


def lit(light: Light | None, words: str) -> str:
    """A light with its words; None: words that are neither good nor bad."""
    return words if light is None else f"{_SIGNS[light]} {words}"
