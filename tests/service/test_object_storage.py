"""Workspaces on object storage, on a real S3-compatible server: results, reuse, damage, runs at once."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.runs.workers import processes
from flows.server.roots import RESULTS_VARIABLE, configured_results, results_of_server, roots_of
from tasks.errors import InputError
from tasks.files.installation import InstallationError
from tasks.object_storage.address import ObjectAddress
from tasks.object_storage.fetch import fetch_results
from tasks.object_storage.workspace import ObjectWorkspace
from tasks.results.publish import OF_SWEEPS, publish
from tasks.results.summary import Summary
from tasks.settings.load import load_project
from tasks.settings.project import Project
from tasks.store.store import Store
from tests.service.object_server import ObjectServer
from tests.service.stages_on_storage import (
    BOTH,
    TABLES,
    make_notes,
    make_tables,
    manifest_at,
    object_of,
    run,
    value_of,
)

pytestmark = [pytest.mark.service, pytest.mark.usefixtures("server")]


def test_another_machine_takes_finished_stages_up_and_a_run_again_puts_nothing_but_the_pointer(
    server: ObjectServer, address: ObjectAddress, project: Project, tmp_path: Path
) -> None:
    assert run(tmp_path / "one", address, project) == BOTH
    assert run(tmp_path / "two", address, project) == []
    server.gate.requests.clear()
    assert run(tmp_path / "one", address, project) == []
    prefix = address.prefix
    assert server.gate.put() == [f"{prefix}/summary.json", f"{prefix}/manifest.json"]


def test_every_object_is_one_put_and_the_manifest_is_the_last(
    server: ObjectServer, address: ObjectAddress, project: Project, tmp_path: Path
) -> None:
    run(tmp_path / "one", address, project)
    put = server.gate.put()
    assert len(put) == len(set(put))
    assert put[-1] == f"{address.prefix}/manifest.json"
    for stage in BOTH:
        of_stage = [name for name in put if f"/.store/{stage}/" in name]
        assert of_stage[-1].endswith("/stage.json")
        assert not any(name.endswith("/stage.json") for name in of_stage[:-1])
    named = {f"{address.prefix}/{entry.object}" for entry in manifest_at(address).artifacts.values()}
    assert named <= set(put)
    assert {method for method, _ in server.gate.requests} <= {"PUT", "GET", "HEAD"}


def test_fetched_results_are_those_of_the_run_with_its_manifest(
    address: ObjectAddress, project: Project, tmp_path: Path
) -> None:
    run(tmp_path / "one", address, project)
    fetched = fetch_results(address, tmp_path / "fetched")
    assert set(fetched.brought) == set(fetched.files) == {f"{name}.parquet" for name in TABLES}
    for name in (*fetched.files, "summary.json", "manifest.json"):
        assert (tmp_path / "fetched" / name).read_bytes() == (tmp_path / "one" / name).read_bytes(), name
    killed = tmp_path / "fetched" / ".images.parquet.4711.tmp"
    killed.write_text("half")
    assert fetch_results(address, tmp_path / "fetched").brought == ()
    assert not killed.exists()
    run(tmp_path / "one", address, project, 2.0, names=("images",))
    fetch_results(address, tmp_path / "fetched")
    assert {path.name for path in (tmp_path / "fetched").glob("*.parquet")} == {"images.parquet"}


@pytest.mark.parametrize("name", ["residuals.parquet", "summary.json", "manifest.json"])
def test_files_of_somebody_else_are_not_replaced_by_fetched_ones(
    address: ObjectAddress, project: Project, tmp_path: Path, name: str
) -> None:
    run(tmp_path / "one", address, project)
    own = tmp_path / "fetched" / name
    own.parent.mkdir()
    own.write_text('{"mine": 1}')
    with pytest.raises(InputError, match=rf"{name}: .* not by aerocal .* output folder"):
        fetch_results(address, own.parent)
    assert own.read_text() == '{"mine": 1}'
    assert {path.name for path in own.parent.iterdir()} == {".store", name}


def test_fetched_files_that_were_changed_since_are_not_replaced(
    address: ObjectAddress, project: Project, tmp_path: Path
) -> None:
    run(tmp_path / "one", address, project)
    fetch_results(address, tmp_path / "fetched")
    changed = tmp_path / "fetched" / "residuals.parquet"
    changed.unlink()
    changed.write_bytes(b"with remarks")
    run(tmp_path / "one", address, project, 2.0)
    with pytest.raises(InputError, match=r"residuals.parquet: .* changed"):
        fetch_results(address, tmp_path / "fetched")
    assert changed.read_bytes() == b"with remarks"
    changed.rename(tmp_path / "fetched" / "remarks")
    fetch_results(address, tmp_path / "fetched")
    assert value_of(tmp_path / "fetched") == 2.0


def test_what_interrupted_fetches_have_left_is_replaced(
    address: ObjectAddress, project: Project, tmp_path: Path
) -> None:
    workspace = ObjectWorkspace.at(address)
    for value in (1.0, 2.0):
        run(tmp_path / "one", address, project, value)
        workspace.storage.put(object_of(address, "residuals"), b"damaged")
        with pytest.raises(InstallationError, match=r"residuals.parquet is damaged"):
            fetch_results(address, tmp_path / "fetched")
    left = {path.name for path in (tmp_path / "fetched").iterdir()}
    assert left == {".store", "images.parquet", "object_points.parquet"}
    run(tmp_path / "one", address, project, 3.0)
    fetch_results(address, tmp_path / "fetched")
    assert value_of(tmp_path / "fetched") == 3.0
    assert not (tmp_path / "fetched" / ".store" / "fetching.json").exists()


def test_results_of_another_kind_of_run_stay(
    address: ObjectAddress, project: Project, tmp_path: Path
) -> None:
    run(tmp_path / "one", address, project)
    run(tmp_path / "two", address, project, names=("sweep",), own=OF_SWEEPS)
    assert set(manifest_at(address).artifacts) == {*TABLES, "sweep"}
    run(tmp_path / "one", address, project, 2.0, names=("images",))
    assert set(manifest_at(address).artifacts) == {"images", "sweep"}


@pytest.mark.parametrize("content", [b"", b"something else of any length"])
def test_a_damaged_object_is_never_used_but_computed_and_put_again(
    address: ObjectAddress, project: Project, tmp_path: Path, content: bytes
) -> None:
    run(tmp_path / "one", address, project)
    workspace = ObjectWorkspace.at(address)
    workspace.storage.put(object_of(address, "residuals"), content)
    with pytest.raises(InstallationError, match="is damaged"):
        fetch_results(address, tmp_path / "fetched")
    assert not (tmp_path / "fetched" / "manifest.json").exists()
    assert run(tmp_path / "two", address, project) == ["make_tables"]
    fetch_results(address, tmp_path / "fetched")
    assert value_of(tmp_path / "fetched") == 1.0


def test_what_is_damaged_behind_the_back_of_its_machine_is_put_again_without_computing(
    address: ObjectAddress, project: Project, tmp_path: Path
) -> None:
    run(tmp_path / "one", address, project)
    workspace, name = ObjectWorkspace.at(address), object_of(address, "residuals")
    size = (tmp_path / "one" / "residuals.parquet").stat().st_size
    # Storages tell times in whole seconds.
    time.sleep(1.1)
    workspace.storage.put(name, bytes(size))
    assert run(tmp_path / "one", address, project) == []
    fetch_results(address, tmp_path / "fetched")
    assert value_of(tmp_path / "fetched") == 1.0


@pytest.mark.parametrize(
    "content", [b"{", b'{"stage": "make_tables", "key": "../..", "files": [], "seconds": 0}']
)
def test_a_damaged_list_of_files_is_as_good_as_none(
    address: ObjectAddress, project: Project, tmp_path: Path, content: bytes
) -> None:
    run(tmp_path / "one", address, project)
    entry = manifest_at(address).artifacts["images"]
    place = f".store/{entry.stage}/{entry.key}/stage.json"
    ObjectWorkspace.at(address).storage.put(place, content)
    assert run(tmp_path / "two", address, project) == ["make_tables"]
    assert run(tmp_path / "three", address, project) == []


def test_a_damaged_manifest_is_replaced_and_not_read_as_results(
    address: ObjectAddress, project: Project, tmp_path: Path
) -> None:
    run(tmp_path / "one", address, project)
    ObjectWorkspace.at(address).storage.put(
        "manifest.json", b'{"artifacts": {"images": {"file": "../../x"}}}'
    )
    assert ObjectWorkspace.at(address).manifest() is None
    run(tmp_path / "one", address, project)
    assert set(manifest_at(address).artifacts) == set(TABLES)


def test_two_machines_at_once_leave_the_results_of_one_of_them(
    address: ObjectAddress, project: Project, tmp_path: Path
) -> None:
    def work(machine: int) -> None:
        for turn in range(4):
            run(tmp_path / f"machine-{machine}", address, project, float(10 * machine + turn))

    threads = [threading.Thread(target=work, args=(machine,)) for machine in (1, 2, 3)]
    for thread in threads:
        thread.start()
    seen = set()
    while any(thread.is_alive() for thread in threads):
        if ObjectWorkspace.at(address).manifest() is not None:
            fetch_results(address, tmp_path / "reader")
            seen.add(value_of(tmp_path / "reader"))
    fetch_results(address, tmp_path / "reader")
    assert value_of(tmp_path / "reader") in {13.0, 23.0, 33.0}
    assert len(seen) > 1, "the reader looked between the runs"


def test_a_manifest_that_is_replaced_while_it_is_read_is_the_old_or_the_new_one(
    server: ObjectServer, address: ObjectAddress, project: Project, tmp_path: Path
) -> None:
    run(tmp_path / "one", address, project, names=("images",))
    replaced: list[bool] = []

    def replace(method: str, path: str) -> None:
        # The client knows the size and has not asked for the content yet; the new one is longer.
        if method == "HEAD" and path.endswith("/manifest.json") and not replaced:
            replaced.append(True)
            run(tmp_path / "two", address, project)

    server.gate.afterwards = replace
    manifest = ObjectWorkspace.at(address).manifest()
    assert manifest is not None
    assert set(manifest.artifacts) == set(TABLES)


def test_machines_that_compute_other_bytes_for_one_key_do_not_spoil_each_other(
    server: ObjectServer, address: ObjectAddress, tmp_path: Path
) -> None:
    stores = [Store.of(tmp_path / name, ObjectWorkspace.at(address)) for name in ("one", "two")]
    # The second begins before the first has finished, so that both compute.
    server.gate.rule = lambda method, path: 404 if method == "HEAD" and "make_notes" in path else None
    made = [make_notes(store, value=7.0)["notes"] for store in stores]
    server.gate.reset()
    assert made[0].sha256 != made[1].sha256
    third = make_notes(Store.of(tmp_path / "three", ObjectWorkspace.at(address)), value=7.0)["notes"]
    assert third.sha256 == made[1].sha256
    again = make_notes(Store.of(tmp_path / "one", ObjectWorkspace.at(address)), value=7.0)["notes"]
    assert again.sha256 == made[0].sha256


def test_worker_processes_keep_their_stages_there(address: ObjectAddress, tmp_path: Path) -> None:
    store = Store.of(tmp_path / "one", ObjectWorkspace.at(address))
    with processes(2) as executor:
        assert executor is not None
        values = [executor.submit(make_notes, store, value=float(number)) for number in range(4)]
        made = [value.result()["notes"].sha256 for value in values]
    other = Store.of(tmp_path / "two", ObjectWorkspace.at(address))
    taken = [make_notes(other, value=float(number))["notes"].sha256 for number in range(4)]
    assert taken == made


def test_wrong_input_is_told_beside_results_that_stay(
    address: ObjectAddress, project: Project, tmp_path: Path
) -> None:
    request = RunRequest.of(tmp_path / "delivery" / "project.toml", str(address), (), None)

    def story(read: Project, store: Store) -> Summary:
        return publish(store, read, [make_tables(store, names=TABLES, project=read, value=5.0)], TABLES)

    assert carry_out(story, request).summary.status == "done"
    assert not fetch_results(address, tmp_path / "fetched").is_older

    def wrong(_project: Project, _store: Store) -> Summary:
        raise InputError("The exposures are empty.", "Deliver them.")

    outcome = carry_out(wrong, request)
    assert (outcome.summary.status, outcome.place) == ("input_error", address)
    found = fetch_results(address, tmp_path / "fetched")
    assert found.is_older
    assert found.last_run is not None
    assert found.last_run.problems == ("The exposures are empty. Deliver them.",)
    assert value_of(tmp_path / "fetched") == 5.0
    assert project == load_project(tmp_path / "delivery" / "project.toml")


def test_a_deployed_run_keeps_its_results_beside_the_project_and_there(
    address: ObjectAddress, tmp_path: Path, project: Project
) -> None:
    roots = roots_of([tmp_path / "delivery"])
    assert results_of_server(str(address), roots) == address
    file = tmp_path / "delivery" / "project.toml"
    place = configured_results(file, "results", roots, {RESULTS_VARIABLE: str(address)})
    assert place == address.below("delivery", "results")
    out = roots.output_folder(file, "results")

    def story(read: Project, store: Store) -> Summary:
        assert read == project
        return publish(store, read, [make_tables(store, names=TABLES, project=read, value=3.0)], TABLES)

    outcome = carry_out(story, RunRequest(file, out, roots=roots.folders, address=place))
    assert outcome.place == outcome.directory == out
    assert value_of(out) == 3.0
    fetch_results(place, tmp_path / "fetched")
    assert value_of(tmp_path / "fetched") == 3.0
    assert not (tmp_path / "workspaces").exists()


def test_there_is_nothing_to_fetch_where_nothing_was_published(
    address: ObjectAddress, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="There are no results"):
        fetch_results(address, tmp_path / "fetched")
    assert not (tmp_path / "fetched").exists()
