"""A stage is a plain call in process and a Prefect task inside a flow run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from flows.runs.stage import flow_run_is_active, stage
from flows.runs.workers import processes
from tasks.errors import InputError
from tasks.files.installation import InstallationError
from tasks.store.artifact import Artifact, verified
from tasks.store.store import Outputs, Store, stored
from tests.waiting import until


@stored("write_text")
def write_text(folder: Path, *, text: str) -> None:
    (folder / "text.txt").write_text(text)


@stored("join_texts")
def join_texts(folder: Path, *, parts: tuple[Artifact, ...]) -> None:
    (folder / "joined.txt").write_text(" ".join(verified(part).read_text() for part in parts))


@stored("refuse")
def refuse(folder: Path, *, text: str) -> None:
    raise InputError(f"'{text}' is wrong.", "Write something else.", file=folder.parent.with_name("x"))


write = stage(write_text)
join = stage(join_texts)
refused = stage(refuse)


def _fetch(record: Path, kind: str) -> None:
    """Fails the first time; `record` counts the trials."""
    trials = record.read_text() if record.exists() else ""
    record.write_text(trials + "trial ")
    if not trials:
        raise ConnectionResetError("lost") if kind == "connection" else ValueError("a defect")


fetch = stage(_fetch)


def story(store: Store) -> Outputs:
    one = write(store, text="one")
    others = write.map([{"text": "two"}, {"text": "three"}], store)
    return join(store, parts=(one["text"], *(other["text"] for other in others)))


def published(outputs: Outputs) -> str:
    return verified(outputs["joined"]).read_text()


def test_outside_a_flow_run_a_stage_is_a_plain_call(tmp_path: Path) -> None:
    assert not flow_run_is_active()
    assert published(story(Store.of(tmp_path))) == "one two three"


def test_a_story_in_process_never_imports_prefect(tmp_path: Path) -> None:
    program = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
        "from pathlib import Path; from test_stage import story; from tasks.store.store import Store\n"
        f"story(Store.of(Path({str(tmp_path)!r})))\n"
        "sys.exit(any(name.split('.')[0] == 'prefect' for name in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.prefect
@pytest.mark.usefixtures("prefect_server")
def test_inside_a_flow_run_every_stage_is_a_task_and_the_bytes_are_the_same(tmp_path: Path) -> None:
    from prefect import flow
    from prefect.client.orchestration import get_client
    from prefect.client.schemas.filters import TaskRunFilter, TaskRunFilterFlowRunId

    @flow(name="story", persist_result=False)
    def as_flow(folder: str) -> tuple[str, str]:
        from prefect.runtime import flow_run

        assert flow_run_is_active()
        return published(story(Store.of(Path(folder)))), str(flow_run.id)

    text, flow_run_id = as_flow(str(tmp_path / "flow"))
    assert text == published(story(Store.of(tmp_path / "plain")))
    of_this_run = TaskRunFilter(flow_run_id=TaskRunFilterFlowRunId(any_=[flow_run_id]))

    def names_of_completed() -> list[str]:
        with get_client(sync_client=True) as client:
            runs = client.read_task_runs(task_run_filter=of_this_run)
        return sorted(run.name.rsplit("-", 1)[0] for run in runs if run.state_name == "Completed")

    # The server records the states of tasks in its own time, also after the end of the flow.
    expected = ["join_texts", "write_text", "write_text", "write_text"]
    until(lambda: names_of_completed() == expected, 60.0)


@pytest.mark.prefect
@pytest.mark.usefixtures("prefect_server")
def test_an_input_error_passes_through_the_task_unchanged_and_without_a_traceback(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    from prefect import flow

    @flow(name="refusal", persist_result=False)
    def as_flow(folder: str) -> str:
        try:
            refused(Store.of(Path(folder)), text="x")
        except InputError as error:
            return str(error)
        return "not refused"

    assert as_flow(str(tmp_path)).endswith("x: 'x' is wrong. Write something else.")
    assert "Finished in state InputError(" in caplog.text
    assert "Traceback" not in caplog.text
    assert "NoneType" not in caplog.text


@pytest.mark.prefect
@pytest.mark.usefixtures("prefect_server")
def test_a_lost_connection_is_tried_once_more_and_a_defect_is_not(tmp_path: Path) -> None:
    from prefect import flow

    @flow(name="trials", persist_result=False)
    def as_flow(folder: str, kind: str) -> str:
        try:
            fetch(Path(folder), kind)
        except (ConnectionError, ValueError) as error:
            return type(error).__name__
        return "done"

    assert as_flow(str(tmp_path / "connection"), "connection") == "done"
    assert as_flow(str(tmp_path / "defect"), "defect") == "ValueError"
    assert (tmp_path / "defect").read_text() == "trial "


@stored("count_calls")
def count_calls(folder: Path, *, text: str, record: str) -> None:
    with Path(record).open("a") as stream:
        stream.write(f"{text} ")
    if text == "wrong":
        raise InputError("The text is wrong.", "Write another.", entity=text)
    (folder / "text.txt").write_text(text)


counted = stage(count_calls)


def tried(store: Store, record: Path, workers: int) -> list[str]:
    """What became of four calls, the second and the last alike, the third impossible."""
    done: list[int] = []
    each = [{"text": text, "record": str(record)} for text in ("one", "two", "wrong", "two")]
    with processes(workers) as executor:
        outcomes = counted.attempt(
            each, store, executor=executor, when_done=lambda index, _outcome: done.append(index)
        )
    assert sorted(done) == [0, 1, 2, 3]
    return [
        str(outcome) if isinstance(outcome, InputError) else verified(outcome["text"]).read_text()
        for outcome in outcomes
    ]


@pytest.mark.parametrize("workers", [1, 2])
def test_an_attempt_stops_no_other_and_calls_that_are_alike_are_made_once(
    tmp_path: Path, workers: int
) -> None:
    found = tried(Store.of(tmp_path / "out"), tmp_path / "record", workers)
    assert found == ["one", "two", "wrong: The text is wrong. Write another.", "two"]
    assert sorted((tmp_path / "record").read_text().split()) == ["one", "two", "wrong"]


@pytest.mark.prefect
@pytest.mark.usefixtures("prefect_server")
def test_inside_a_flow_run_every_attempt_is_a_task_carried_out_by_a_worker(tmp_path: Path) -> None:
    from prefect import flow

    @flow(name="attempts", persist_result=False)
    def as_flow(folder: str) -> list[str]:
        return tried(Store.of(Path(folder) / "out"), Path(folder) / "record", 2)

    assert as_flow(str(tmp_path)) == ["one", "two", "wrong: The text is wrong. Write another.", "two"]


def test_a_defect_in_a_worker_ends_everything() -> None:
    with pytest.raises(ValueError, match="a defect"), processes(2) as executor:
        stage(_broken).attempt([{"name": "a"}, {"name": "b"}], executor=executor)


def _broken(name: str) -> str:
    raise ValueError(f"a defect of {name}")


def test_a_worker_that_is_ended_from_outside_is_said_so() -> None:
    with pytest.raises(InstallationError, match="terminated from outside"), processes(2) as executor:
        stage(_ended).attempt([{"sent": int(signal.SIGKILL)}], executor=executor)


def _ended(sent: int) -> None:
    os.kill(os.getpid(), sent)


def test_workers_compute_on_one_thread_and_are_deaf_to_the_interrupt_key() -> None:
    with processes(2) as executor:
        assert executor is not None
        assert executor.submit(os.getenv, "AEROCAL_THREADS").result() == "1"
        assert executor.submit(signal.getsignal, signal.SIGINT).result() == signal.SIG_IGN
    assert os.getenv("AEROCAL_THREADS") is None
