"""What the board of production shows of the records, and how little it reads to keep up."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from pathlib import Path

from tasks.production.board import Board, ProjectRow
from tasks.production.records import Records
from tests.tasks.production.runs import ended, run, stages, summary


def only(rows: tuple[ProjectRow, ...]) -> ProjectRow:
    (row,) = rows
    return row


def test_a_row_is_the_latest_run_of_a_story_on_a_project(records: Records) -> None:
    ended(records, run(hours=0), "InputError", "wrong")
    latest = ended(records, run(hours=1), "GateFailed", figures=summary(1.4))
    other = ended(records, run(hours=0, story="system-calibration", directory="/data/block-7/calibration"))
    rows = {row.run.story: row for row in Board(records).changes(None).rows}
    assert {row.run.id for row in rows.values()} == {latest.id, other.id}
    row = rows["aerial-triangulation"]
    assert (row.runs, row.run.state, row.failed_gates) == (2, "GateFailed", ("sigma0",))
    assert (row.run.figures.sigma0, row.run.figures.rmse_check_m) == (1.4, (0.011, 0.012, 0.031))
    assert (row.run.figures.trust_map_plan_m, row.run.figures.trust_map_height_m) == (None, 0.043)
    assert (row.limit("sigma0"), row.limit("rmse_check_m_x")) == (1.2, None)
    assert row.documents == ("report.html",)
    assert set(row.stages.values()) == {"done"}


def test_a_rescheduled_file_of_another_name_is_another_project(records: Records) -> None:
    ended(records, run(project_file="/data/block-7/strict.toml"))
    ended(records, run())
    assert len(Board(records).changes(None).rows) == 2


def test_refused_runs_without_a_project_file_are_told_apart_by_what_was_asked_for(records: Records) -> None:
    for name in ("../a", "../b"):
        ended(records, run(name, project_file="", directory=""), "InputError", "There is none.")
    assert {row.run.project for row in Board(records).changes(None).rows} == {"../a", "../b"}


def test_results_belong_to_the_run_that_wrote_the_folder_last(records: Records) -> None:
    ended(records, run(hours=0))
    ended(records, run(hours=1, story="system-calibration"))
    ended(records, run(hours=2, story="direct-georeferencing-check"), "InputError", "wrong")
    found = {row.run.story: row.documents for row in Board(records).changes(None).rows}
    assert found == {
        "aerial-triangulation": (),
        "system-calibration": ("report.html",),
        "direct-georeferencing-check": (),
    }


def test_a_sweep_leaves_the_results_of_an_adjustment_beside_it(records: Records) -> None:
    ended(records, run(hours=0))
    ended(records, run(hours=1, story="scenario-sweep"), done=stages("sweep_table", "sweep_page"))
    found = {row.run.story: row.documents for row in Board(records).changes(None).rows}
    assert found == {"aerial-triangulation": ("report.html",), "scenario-sweep": ("sweep.html",)}
    assert all(records.holds_results(run) for run in records.runs())


def test_only_what_changed_is_told(records: Records) -> None:
    for number in range(5):
        ended(records, run(f"block-{number}"))
    board = Board(records)
    first = board.changes(None)
    assert (first.whole, len(first.rows)) == (True, 5)
    assert board.changes(first.revision).is_empty
    ended(records, run("block-3", hours=1), "GateFailed", figures=summary(1.4))
    ended(records, run("block-9"))
    second = board.changes(first.revision)
    assert [row.run.project for row in second.rows] == ["block-3", "block-9"]
    assert not second.whole
    assert board.changes(second.revision).is_empty
    # Somebody who was away gets the same.
    assert board.changes(first.revision) == second


def test_whoever_knows_another_board_is_told_everything(records: Records) -> None:
    ended(records, run())
    before = Board(records).changes(None).revision
    assert Board(records).changes(before).whole


def test_runs_that_are_gone_are_taken_off(records: Records) -> None:
    board = Board(records)
    kept = run()
    records.schedule(kept)
    first = board.changes(None)
    with records.engine.connect() as connection, connection.begin():
        connection.exec_driver_sql("DELETE FROM aerocal_runs")
    assert board.changes(first.revision).removed == (only(first.rows).key,)
    assert board.rows() == ()


def test_a_run_that_learns_its_project_file_when_it_begins_keeps_one_row(records: Records) -> None:
    waiting = run(project_file="block-7", directory="")
    records.schedule(waiting)
    board = Board(records)
    first = board.changes(None)
    records.begin(replace(waiting, project_file="/data/block-7/project.toml"))
    second = board.changes(first.revision)
    assert second.removed == (only(first.rows).key,)
    assert only(board.rows()).run.state == "Running"


def test_stages_of_a_run_in_work_are_read_from_its_folder(records: Records, tmp_path: Path) -> None:
    one = run(directory=str(tmp_path))
    records.begin(one)
    board = Board(records)
    first = board.changes(None)
    assert only(first.rows).stages["import_exposures"] == "running"
    begun = records.run(one.id)
    assert begun is not None
    assert begun.begun is not None
    for number, (stage, later) in enumerate(
        (("report", -60.0), ("import_exposures", 1.0), ("import_control", 2.0))
    ):
        _keep(tmp_path, number, stage, (begun.begun + timedelta(seconds=later)).isoformat())
    row = only(board.changes(first.revision).rows)
    assert dict(row.stages) == {
        "import_exposures": "done",
        "import_control": "done",
        "import_image_points": "running",
        "approximate_values": "waiting",
        "bundle_adjustment": "waiting",
        "remarks": "waiting",
        "report": "waiting",
    }


def _keep(folder: Path, number: int, stage: str, started: str) -> None:
    from tasks.store.stage_record import StageRecord, keep_record

    (folder / ".store").mkdir(exist_ok=True)
    keep_record(folder / ".store", StageRecord(stage, str(number), False, started, 1.0, {}, {}))


def test_a_run_that_failed_shows_the_stage_and_its_message_first(records: Records) -> None:
    figures = {"problems": ["exposures.csv:7: A1: no number."]}
    ended(
        records, run(), "InputError", "exposures.csv:7: A1: no number.",
        done=stages("import_exposures", reused=True), failed_stage="import_control", figures=figures,
    )  # fmt: skip
    row = only(Board(records).changes(None).rows)
    assert row.problem == "exposures.csv:7: A1: no number."
    assert row.stages["import_exposures"] == "reused"
    assert row.stages["import_control"] == "failed"
    assert row.stages["report"] == "waiting"
    assert row.documents == ()


def test_a_summary_of_another_aerocal_is_no_reason_to_show_nothing(records: Records) -> None:
    figures = {"sigma0": "good", "rmse_check_m": [1.0], "gates": [{"name": "new"}, 7], "problems": "none"}
    ended(records, run(), figures=figures)  # type: ignore[arg-type]
    row = only(Board(records).changes(None).rows)
    told = row.run.figures
    assert (told.sigma0, told.rmse_check_m, told.gates, row.problem) == (None, (None, None, None), (), None)


def test_a_run_that_somebody_has_started_again_is_the_latest(records: Records) -> None:
    first = ended(records, run(hours=0))
    second = ended(records, run(hours=1), "NotComputable", "No convergence.")
    assert only(Board(records).changes(None).rows).run == second
    again = ended(records, first)
    row = only(Board(records).changes(None).rows)
    assert (row.run, row.runs, row.documents) == (again, 2, ("report.html",))
    waiting = run(hours=0.5)
    records.schedule(waiting)
    assert only(Board(records).changes(None).rows).run == waiting
