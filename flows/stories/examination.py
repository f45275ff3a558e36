"""Examine a project: read and check it, compute approximate values, adjust nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from flows.stories.block_preparation import prepare_block
from tasks.files.json_text import JSON
from tasks.settings.project import Project
from tasks.store.notes import read_notes
from tasks.store.store import Store

_NAMES = ("exposures and cameras", "control", "image points", "approximate values")


@dataclass(frozen=True)
class Finding:
    """What one stage found.

    Attributes
    ----------
    subject : what was looked at.
    figures : counts and numbers.
    problems : suspicions, plain sentences.
    """

    subject: str
    figures: Mapping[str, JSON]
    problems: tuple[str, ...]


def examine_project(project: Project, store: Store) -> tuple[Finding, ...]:
    """Read the deliveries and find approximate values; what is there, and what looks wrong."""
    block = prepare_block(project, store)
    notes = [read_notes(outputs["notes"]) for outputs in block.stages]
    return tuple(Finding(name, note.figures, note.problems) for name, note in zip(_NAMES, notes, strict=True))
