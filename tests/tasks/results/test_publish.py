"""What a run leaves in its output folder."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from tasks.errors import InputError
from tasks.files.installation import InstallationError
from tasks.results.publish import publish
from tasks.results.summary import Summary
from tasks.settings.load import load_project
from tasks.settings.project import Project
from tasks.store.notes import Notes, write_notes
from tasks.store.run_lock import run_lock
from tasks.store.store import Store, stored


@stored("make_tables")
def make_tables(folder: Path, *, names: tuple[str, ...], project: Project, sigma0: float) -> None:
    assert project.project.name == "small"
    for name in names:
        table = pd.DataFrame({"point": [f"{name}-1", f"{name}-2"], "sigma0": sigma0})
        table.to_parquet(folder / f"{name}.parquet")
    write_notes(folder, Notes(("a problem",), {"sigma0": sigma0}))


@pytest.fixture
def project(tmp_path: Path, write_project: Callable[..., Path]) -> Project:
    return load_project(write_project(tmp_path / "delivery", "[gates]\nsigma0 = { max = 1.2 }\n"))


def run(out: Path, project: Project, names: tuple[str, ...], sigma0: float = 1.0) -> Summary:
    store = Store.of(out)
    store.begin_run()
    return publish(store, project, [make_tables(store, names=names, project=project, sigma0=sigma0)])


def manifest(out: Path) -> dict[str, dict[str, dict[str, object]]]:
    content = json.loads((out / "manifest.json").read_text())
    assert isinstance(content, dict)
    return content


def files(out: Path) -> set[str]:
    return {path.name for path in out.iterdir()}


def test_published_are_the_tables_of_the_contract_and_nothing_internal(
    tmp_path: Path, project: Project
) -> None:
    run(tmp_path / "out", project, ("images", "object_points", "approximate_points"))
    expected = {".store", "images.parquet", "object_points.parquet", "summary.json", "manifest.json"}
    assert files(tmp_path / "out") == expected


def test_the_manifest_tells_where_everything_comes_from(tmp_path: Path, project: Project) -> None:
    out = tmp_path / "out"
    run(out, project, ("images",))
    content = manifest(out)
    entry = content["artifacts"]["images"]
    assert entry["sha256"] == hashlib.sha256((out / "images.parquet").read_bytes()).hexdigest()
    assert (out / ".store" / str(entry["stage"]) / str(entry["key"]) / "images.parquet").is_file()
    assert (entry["rows"], entry["file"]) == (2, "images.parquet")
    delivered = tmp_path / "delivery" / "image_points.csv"
    assert content["inputs"][str(delivered)] == hashlib.sha256(delivered.read_bytes()).hexdigest()
    assert content["settings"]["project"]["name"] == "small"
    assert {"aerocal", "numpy", "PROJ"} <= set(content["versions"])
    assert str(content["times"]["started"]) <= str(content["times"]["finished"])


def test_a_second_run_replaces_the_files_and_leaves_no_temporary_ones(
    tmp_path: Path, project: Project
) -> None:
    run(tmp_path / "out", project, ("images", "check_points"))
    before = files(tmp_path / "out")
    run(tmp_path / "out", project, ("images", "check_points"))
    assert files(tmp_path / "out") == before


def test_what_a_killed_run_was_publishing_is_swept(tmp_path: Path, project: Project) -> None:
    out = tmp_path / "out"
    run(out, project, ("images",))
    before = files(out)
    (out / ".images.parquet.4711.tmp").write_text("half")
    (out / ".own.tmp").write_text("a user's own file")
    run(out, project, ("images",))
    assert files(out) == before | {".own.tmp"}


def test_a_table_this_run_does_not_have_does_not_stay_from_the_last(tmp_path: Path, project: Project) -> None:
    out = tmp_path / "out"
    run(out, project, ("images", "check_points"))
    run(out, project, ("images",))
    assert "check_points.parquet" not in files(out)
    run(out, project, ("images", "check_points"))
    (out / "check_points.parquet").unlink()
    (out / "check_points.parquet").write_text("a user's own file")
    run(out, project, ("images",))
    assert (out / "check_points.parquet").read_text() == "a user's own file"


def require_refused(out: Path, project: Project, name: str) -> None:
    """A run that would replace a file names it and writes nothing."""
    before = contents(out)
    with pytest.raises(InputError, match=f"{name}: .* not by aerocal or was changed since.* Rename it"):
        run(out, project, ("images", "object_points"), sigma0=1.1)
    assert contents(out) == before


def contents(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()}


@pytest.mark.parametrize("name", ["object_points.parquet", "summary.json", "manifest.json"])
def test_a_file_of_somebody_else_is_not_replaced(tmp_path: Path, project: Project, name: str) -> None:
    out = tmp_path / "out"
    run(out, project, ("images",))
    (out / name).unlink(missing_ok=True)
    (out / name).write_text('{"mine": 1}')
    require_refused(out, project, name)
    (out / name).rename(out / "mine")
    run(out, project, ("images", "object_points"))
    assert (out / "mine").read_text() == '{"mine": 1}'


@pytest.mark.parametrize("in_place", [True, False])
def test_a_published_file_that_was_edited_is_not_replaced(
    tmp_path: Path, project: Project, in_place: bool
) -> None:
    out = tmp_path / "out"
    run(out, project, ("images",))
    published = out / "images.parquet"
    if in_place:
        # The store has the same bytes then.
        published.chmod(0o644)
    else:
        published.unlink()
    published.write_bytes(b"edited")
    require_refused(out, project, "images.parquet")


def test_what_a_killed_run_has_published_is_replaced(tmp_path: Path, project: Project) -> None:
    out = tmp_path / "out"
    run(out, project, ("images",))
    earlier = {name: (out / name).read_bytes() for name in ("summary.json", "manifest.json")}
    # Of the next run the tables alone got their names.
    run(out, project, ("images", "object_points"), sigma0=1.1)
    for name, content in earlier.items():
        (out / name).write_bytes(content)
    run(out, project, ("images", "object_points"), sigma0=1.15)
    assert set(pd.read_parquet(out / "object_points.parquet")["sigma0"]) == {1.15}


def test_a_failed_gate_keeps_the_outputs(tmp_path: Path, project: Project) -> None:
    summary = run(tmp_path / "out", project, ("images",), sigma0=1.3)
    assert summary.status == "gate_failed"
    assert {"images.parquet", "manifest.json"} <= files(tmp_path / "out")
    assert summary.problems == ("a problem",)


def test_a_target_that_cannot_be_written_is_one_clear_message(tmp_path: Path, project: Project) -> None:
    out = tmp_path / "out"
    (out / "images.parquet").mkdir(parents=True)
    with pytest.raises(InstallationError, match="cannot be written"):
        run(out, project, ("images",))
    assert files(out) == {".store", "images.parquet"}


def test_a_manifest_that_was_delivered_with_the_folder_removes_nothing_elsewhere(
    tmp_path: Path, project: Project
) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    run(out, project, ("images", "object_points"))
    elsewhere.write_text("must stay")
    content = manifest(out)
    digest = hashlib.sha256(elsewhere.read_bytes()).hexdigest()
    for file in ("../elsewhere", str(elsewhere)):
        content["artifacts"]["residuals"] = {
            **content["artifacts"]["images"], "file": file, "sha256": digest, "rows": None,
        }  # fmt: skip
        (out / "manifest.json").write_text(json.dumps(content))
        run(out, project, ("images",))
        assert elsewhere.read_text() == "must stay"


def test_results_are_not_published_into_a_folder_that_was_swapped_meanwhile(
    tmp_path: Path, project: Project
) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "images.parquet").write_text("must stay")
    with run_lock(out):
        store = Store.of(out)
        store.begin_run()
        made = make_tables(store, names=("images",), project=project, sigma0=1.0)
        # Everything the run made is there, too, so that it would be found.
        shutil.copytree(out / ".store", elsewhere / ".store")
        out.rename(tmp_path / "aside")
        out.symlink_to(elsewhere)
        with pytest.raises(InstallationError, match="moved or replaced"):
            publish(store, project, [made])
    assert (elsewhere / "images.parquet").read_text() == "must stay"


def test_a_stored_output_that_names_a_file_elsewhere_is_computed_again(
    tmp_path: Path, project: Project
) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere.parquet"
    run(out, project, ("images",))
    (place,) = (out / ".store" / "make_tables").iterdir()
    elsewhere.write_bytes((place / "images.parquet").read_bytes())
    content = json.loads((place / "stage.json").read_text())
    for entry in content["files"]:
        if entry["file"] == "images.parquet":
            entry["file"] = str(elsewhere)
    place.chmod(0o755)
    (place / "stage.json").unlink()
    (place / "stage.json").write_text(json.dumps(content))
    run(out, project, ("images",))
    (stored_again,) = (out / ".store" / "make_tables").iterdir()
    assert (stored_again / "images.parquet").stat().st_nlink == 2
    assert elsewhere.stat().st_nlink == 1
