"""A mistake in a delivery: its description, the evidence, and its correction."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Attributes
    ----------
    what : what it looks like, a sentence.
    evidence : what was measured under each hypothesis, the best first.
    remedy : what to do, a sentence.
    declare : the line of the project file, ``a.b.c = value`` from its top; empty: the files must be
    corrected.
    """

    what: str
    evidence: tuple[str, ...]
    remedy: str
    declare: str = ""
