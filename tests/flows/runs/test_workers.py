"""Who carries out the runs of a stage, and what a worker of a cluster must have in common with a run."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from flows.runs.cluster_worker import Expected
from flows.runs.workers import DASK_VARIABLE, cluster_address, use_cluster, workers
from tasks.store.software import software_here


@pytest.mark.parametrize(
    ("variable", "option", "expected"),
    [
        (None, None, None),
        ("", None, None),
        ("none", None, None),
        ("tcp://a:8786", None, "tcp://a:8786"),
        ("tcp://a:8786", "tcp://b:8786", "tcp://b:8786"),
        ("tcp://a:8786", "none", None),
    ],
)
def test_the_option_comes_before_the_variable(
    variable: str | None, option: str | None, expected: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(DASK_VARIABLE, variable or "")
    use_cluster(option)
    assert cluster_address() == expected


def test_without_a_cluster_dask_is_not_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(DASK_VARIABLE, raising=False)
    program = (
        "import sys; from pathlib import Path; from flows.runs.workers import workers\n"
        f"with workers(1, (Path({str(tmp_path)!r}),)) as executor: assert executor is None\n"
        "sys.exit('distributed' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_one_process_needs_no_executor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(DASK_VARIABLE, "none")
    with workers(1, (tmp_path,)) as executor:
        assert executor is None


def test_a_worker_says_why_it_cannot_take_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLIGHTS", "/data")
    seen = tmp_path / "seen"
    seen.write_text("words")
    fit = Expected(software_here(), ((seen, "words"),), (("FLIGHTS", "/data"), ("UNSET", None)))
    assert fit.trouble(threads=1) is None
    for unfit, threads, words in (
        (fit, 2, "has 2 threads"),
        (replace(fit, software=replace(software_here(), sources="0")), 1, "other source files"),
        (replace(fit, words=((seen, "others"),)), 1, "does not see"),
        (replace(fit, words=((tmp_path / "missing", "words"),)), 1, "does not see"),
        (replace(fit, environment=(("FLIGHTS", "/other"),)), 1, "has FLIGHTS set differently"),
    ):
        trouble = unfit.trouble(threads)
        assert trouble is not None
        assert words in trouble.what
        assert "/data" not in str(trouble.of("tcp://a:1"))
