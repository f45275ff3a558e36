"""Notes of a stage: written, read back, without NaN."""

from __future__ import annotations

from pathlib import Path

import pytest

from tasks.files.installation import InstallationError
from tasks.files.json_text import JSON, finite, json_text
from tasks.store.artifact import artifact_of
from tasks.store.notes import Notes, read_notes, write_notes


def test_notes_come_back_as_they_were_written(tmp_path: Path) -> None:
    figures: dict[str, JSON] = {"sigma0": 1.05, "counts": {"images": 20}, "none": None}
    notes = Notes(("a problem", "another"), figures, suspicions=("another",), reasons=("a problem",))
    write_notes(tmp_path, notes)
    assert read_notes(artifact_of(tmp_path / "notes.json")) == notes


def test_a_figure_that_could_not_be_computed_is_null(tmp_path: Path) -> None:
    write_notes(tmp_path, Notes((), {"sigma0": float("nan"), "list": [1.0, float("inf")]}))
    assert read_notes(artifact_of(tmp_path / "notes.json")).figures == {"sigma0": None, "list": [1.0, None]}


def test_changed_notes_are_not_read(tmp_path: Path) -> None:
    write_notes(tmp_path, Notes(("a problem",), {}))
    artifact = artifact_of(tmp_path / "notes.json")
    write_notes(tmp_path, Notes((), {}))
    with pytest.raises(InstallationError, match="was changed"):
        read_notes(artifact)


def test_one_content_has_one_text() -> None:
    assert json_text({"b": 1, "a": [1.5, None, "σ0"]}) == json_text({"a": (1.5, None, "σ0"), "b": 1})
    assert finite({"a": {"b": float("-inf")}}) == {"a": {"b": None}}
