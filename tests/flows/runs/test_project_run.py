"""One run of a story: what its outcome is, and what it leaves behind."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from flows.runs.project_run import RunRequest, carry_out
from tasks.errors import InputError, NotComputableError
from tasks.results.publish import publish
from tasks.results.summary import Summary
from tasks.settings.project import Project
from tasks.store.notes import Notes, write_notes
from tasks.store.store import Store, stored

Write = Callable[..., Path]


@stored("count")
def count(folder: Path, *, project: Project) -> None:
    points = project.inputs.image_points[0].file.read_text().splitlines()[1:]
    write_notes(folder, Notes((), {"counts": {"image_points": len(points)}}))


def counting(project: Project, store: Store) -> Summary:
    return publish(store, project, [count(store, project=project)])


def refusing(project: Project, store: Store) -> Summary:
    count(store, project=project)
    raise InputError("The points are in the wrong unit.", "Write unit = 'px'.", project.cameras["C"].file)


def failing(project: Project, store: Store) -> Summary:
    count(store, project=project)
    raise NotComputableError(f"The datum of {project.project.name} is not fixed.")


def summary_in(out: Path) -> dict[str, object]:
    content = json.loads((out / "summary.json").read_text())
    assert isinstance(content, dict)
    return content


def test_results_go_beside_the_project_file_by_default(tmp_path: Path, write_project: Write) -> None:
    outcome = carry_out(counting, RunRequest(write_project(tmp_path)))
    assert outcome.directory == tmp_path / "results"
    assert outcome.summary.status == "done"
    assert outcome.summary.counts.image_points == 2
    assert outcome.error is None
    assert (tmp_path / "results" / "manifest.json").is_file()


@pytest.mark.parametrize(
    ("story", "status", "word"),
    [(refusing, "input_error", "wrong unit"), (failing, "not_computable", "datum")],
)
def test_without_a_result_the_summary_says_why_and_nothing_else_changes(
    tmp_path: Path, write_project: Write, story: object, status: str, word: str
) -> None:
    request = RunRequest(write_project(tmp_path), tmp_path / "out")
    carry_out(counting, request)
    manifest = (tmp_path / "out" / "manifest.json").read_bytes()
    outcome = carry_out(story, request)  # type: ignore[arg-type]
    assert outcome.error is not None
    assert word in outcome.error
    content = summary_in(tmp_path / "out")
    assert content["status"] == status
    assert word in str(content["problems"])
    assert content["sigma0"] is None
    assert (tmp_path / "out" / "manifest.json").read_bytes() == manifest


def test_an_error_in_the_project_file_is_in_the_summary(tmp_path: Path, write_project: Write) -> None:
    file = write_project(tmp_path, "[gates]\nsigma00 = { max = 1.2 }\n")
    outcome = carry_out(counting, RunRequest(file))
    assert outcome.summary.status == "input_error"
    assert "sigma0" in str(summary_in(tmp_path / "results")["problems"])


def test_a_mistyped_project_path_leaves_no_folder(tmp_path: Path) -> None:
    outcome = carry_out(counting, RunRequest(tmp_path / "projct.toml"))
    assert outcome.summary.status == "input_error"
    assert list(tmp_path.iterdir()) == []


def test_values_given_on_the_command_line_replace_those_of_the_file(
    tmp_path: Path, write_project: Write
) -> None:
    file = write_project(tmp_path)
    overrides = ("gates.sigma0={ max = 1.0 }",)
    outcome = carry_out(counting, RunRequest(file, overrides=overrides))
    assert outcome.summary.status == "gate_failed"
