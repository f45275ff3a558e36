"""What the program of a run takes, before anything begins; and what it says."""

from __future__ import annotations

import logging
import tempfile
from pathlib import Path

import pytest

from flows.serving.engine import foreseen, trouble_in

pytestmark = pytest.mark.prefect


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        (
            {"project": "block", "evil": 1, "x\x1b": 2},
            r"There is no parameter evil, x\u001b. There are: project,",
        ),
        ({}, "project"),
        ({"project": 3}, "project"),
        ({"project": "block", "settings": {"inputs.control.file": "/etc/passwd"}}, "inputs.control.file"),
        *(
            ({"project": "block", "output": name}, "is not the name of an output folder")
            for name in (".git", ".store", "a/b", "a\nb", "results\n", "a\u202eb", "..", "\t")
        ),
    ],
)
def test_parameters_that_a_story_does_not_take_are_refused_in_one_line(
    parameters: dict[str, object], said: str
) -> None:
    from flows.serving.deployed import aerial_triangulation

    trouble = trouble_in(aerial_triangulation, parameters)
    assert trouble is not None
    assert said in trouble
    assert trouble.isprintable()


@pytest.mark.parametrize("output", ["results", "a b", "Ergebnisse-für-Ä", "2026.11", "ſ…"])
def test_parameters_that_it_takes_are_not(output: str) -> None:
    from flows.serving.deployed import aerial_triangulation, clean_up

    assert trouble_in(aerial_triangulation, {"project": "block", "output": output}) is None
    assert trouble_in(clean_up, {"keep_days": 3}) is None


def test_every_deployment_refuses_unknown_parameters_and_tells_the_places_of_its_server() -> None:
    from flows.server.roots import Roots
    from flows.server.settings import Settings
    from flows.serving.deployments import deployments
    from flows.serving.served_places import places_in, places_of

    roots = Roots((Path("/data/b"), Path("/data/a")))
    settings = Settings(roots, Path(), inbox=Path(), recalibration_cron="0 6 * * 1", keep_days=9)
    made = deployments(settings)
    assert len(made) == 8
    for one in made:
        schema = one._parameter_openapi_schema.model_dump(mode="json", exclude_unset=True)
        assert (schema["additionalProperties"], one.enforce_parameter_schema) == (False, True), one.name
        # For further runners.
        assert places_in(schema) == places_of(settings)


@pytest.mark.parametrize(
    ("message", "level"),
    [
        ("Finished in state InputError('control.csv has no rows')", logging.WARNING),
        ("Finished in state Failed('A defect')", logging.ERROR),
        ("Task run encountered an exception", logging.ERROR),
    ],
)
def test_only_what_is_foreseen_is_no_error(message: str, level: int) -> None:
    record = logging.LogRecord("prefect.task_runs", logging.ERROR, "", 1, message, None, None)
    assert foreseen(record)
    assert record.levelno == level


def test_runners_of_several_users_share_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from flows.serving.deployments import DrainingRunner

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folders = {DrainingRunner(1)._tmp_dir for _ in range(2)}
    assert [folder.parent for folder in folders] == [tmp_path, tmp_path]
