"""Where deployed runs keep results on object storage: what the server was told, never what a run says."""

from __future__ import annotations

from pathlib import Path

import pytest

from flows.server.roots import (
    RESULTS_VARIABLE,
    ROOTS_VARIABLE,
    Roots,
    as_variable,
    configured_results,
    results_of_server,
    roots_of,
)
from tasks.errors import InputError
from tasks.production.outbox import Outbox
from tasks.production.records import Records
from tasks.production.run_record import RECORDS_VARIABLE

TOLD = {RESULTS_VARIABLE: "s3://surveys/production"}


@pytest.fixture
def roots(tmp_path: Path) -> Roots:
    for folder in ("projects/2026/block 42", "inbox/block 42", "projects/a#b"):
        (tmp_path / folder).mkdir(parents=True)
    return roots_of([tmp_path / "projects", tmp_path / "inbox"])


def place(roots: Roots, tmp_path: Path, project: str, output: str = "results") -> str:
    return str(configured_results(tmp_path / project / "project.toml", output, roots, TOLD))


def test_every_project_and_output_has_a_place_of_its_own(roots: Roots, tmp_path: Path) -> None:
    below = "s3://surveys/production"
    assert place(roots, tmp_path, "projects/2026/block 42") == f"{below}/projects/2026/block 42/results"
    assert place(roots, tmp_path, "inbox/block 42") == f"{below}/inbox/block 42/results"
    assert place(roots, tmp_path, "inbox/block 42", "strict") == f"{below}/inbox/block 42/strict"
    assert place(roots, tmp_path, "inbox") == f"{below}/inbox/results"


def test_without_an_address_results_stay_beside_the_project(roots: Roots, tmp_path: Path) -> None:
    file = tmp_path / "projects" / "2026" / "project.toml"
    assert configured_results(file, "results", roots, {}) is None
    assert configured_results(file, "results", roots, {RESULTS_VARIABLE: ""}) is None
    assert results_of_server(None, roots) is None


@pytest.mark.parametrize(("project", "output"), [("projects/a#b", "results"), ("inbox", "..")])
def test_a_name_that_cannot_stand_in_an_address_is_wrong_input(
    roots: Roots, tmp_path: Path, project: str, output: str
) -> None:
    with pytest.raises(InputError, match="is not allowed in an address"):
        place(roots, tmp_path, project, output)


@pytest.mark.parametrize("text", ["results", "s3://surveys", "s3://KEY:geheim@surveys/production"])
def test_a_server_is_told_an_address_or_does_not_start(roots: Roots, text: str) -> None:
    with pytest.raises(InputError) as refused:
        results_of_server(text, roots)
    assert "geheim" not in str(refused.value)


def test_folders_of_one_name_would_share_places_and_are_refused(roots: Roots, tmp_path: Path) -> None:
    (tmp_path / "other" / "inbox").mkdir(parents=True)
    alike = roots_of([*roots.folders, tmp_path / "other" / "inbox"])
    with pytest.raises(InputError, match="Two folders are named 'inbox'"):
        results_of_server("s3://surveys/production", alike)


@pytest.mark.prefect
def test_a_refused_run_stays_that_of_its_project(
    roots: Roots, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever reads the notice looks for the project, and the page for its other runs."""
    from flows.serving import deployed

    file, records = tmp_path / "projects" / "a#b" / "project.toml", Records.at(str(tmp_path / "r.sqlite"))
    file.touch()
    told = {
        **TOLD, ROOTS_VARIABLE: as_variable(roots), RECORDS_VARIABLE: str(tmp_path / "r.sqlite"),
        "PREFECT_API_URL": "http://127.0.0.1:9/api",
    }  # fmt: skip
    for name, value in told.items():
        monkeypatch.setenv(name, value)
    assert deployed.aerial_triangulation.fn("a#b").name == "InputError"
    (run,) = records.runs()
    assert (run.project, run.project_file, run.state) == ("a#b", str(file.resolve()), "InputError")
    (notice,) = Outbox(records).waiting()
    assert notice.subject.startswith("InputError: a#b (")
    assert "is not allowed in an address" in notice.message
