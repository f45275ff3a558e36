"""Output of a stage in addition to its tables: problems as sentences, figures for summary.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

from tasks.files.json_text import JSON, finite, read_json, replace_json
from tasks.store.artifact import Artifact, verified

NOTES = "notes.json"


@dataclass(frozen=True)
class Notes:
    """Remarks of one stage.

    Attributes
    ----------
    problems : plain sentences shown to the user, the most serious first.
    figures : counts and numbers, merged into summary.json by publish; a figure that could not be
        computed is null (NaN is written as null).
    suspicions : those of the problems that say the delivery itself is wrong.
    reasons : those of the problems that refuse or restrict the result of the run as a whole.
    """

    problems: tuple[str, ...] = ()
    figures: Mapping[str, JSON] = field(default_factory=dict)
    suspicions: tuple[str, ...] = ()
    reasons: tuple[str, ...] = ()


def write_notes(folder: Path, notes: Notes) -> None:
    """Write ``notes.json`` into a stage's output folder."""
    replace_json(
        folder / NOTES,
        {
            "problems": list(notes.problems),
            "figures": finite(notes.figures),
            "suspicions": list(notes.suspicions),
            "reasons": list(notes.reasons),
        },
    )


def read_notes(artifact: Artifact) -> Notes:
    """Read the notes a stage has written, after their digest was checked."""
    content = cast(Mapping[str, JSON], read_json(verified(artifact)))
    figures = cast(Mapping[str, JSON], content["figures"])
    problems, suspicions, reasons = (
        tuple(cast(list[str], content[name])) for name in ("problems", "suspicions", "reasons")
    )
    return Notes(problems, figures, suspicions, reasons)
