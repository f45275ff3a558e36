"""Twenty deliveries at once on SQLite and on PostgreSQL: no error in a log, every line dated, all counted."""

from __future__ import annotations

import re
import time
import urllib.request
from collections import Counter
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from flows.server.door import basic
from tests.flows.conftest import write_block
from tests.postgresql_server import PASSWORD
from tests.service.served import Served, served, until

pytestmark = [pytest.mark.fault, pytest.mark.timeout(3600)]

NUMBER = 20
#: What is wrong with two of them: file, what stands there, what is put there.
_SLIPS = {7: ("exposures.csv", "omega", "course"), 13: ("project.toml", "min = 0.7, max = 1.3", "max = 0.01")}
_EXPECTED = Counter({"Completed": NUMBER - len(_SLIPS), "InputError": 1, "GateFailed": 1})
_DATED = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d")
_WRONG = re.compile(r"\bERROR\b|\bCRITICAL\b|Traceback|database is locked|unexpected exception|deadlock")


@pytest.mark.parametrize("database", ["sqlite", "postgresql"])
def test_twenty_at_once_leave_no_error_and_are_counted(
    tmp_path: Path,
    database: str,
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    options = ["--limit", "4"]
    if database == "postgresql":
        monkeypatch.setenv("PGPASSWORD", PASSWORD)
        address = request.getfixturevalue("postgresql").emptied().replace(f":{PASSWORD}@", "@")
        options += ["--database", address]
    folders = [write_block(tmp_path / "inbox" / f"block-{number:02d}").parent for number in range(NUMBER)]
    for number, (name, old, new) in _SLIPS.items():
        file = folders[number] / name
        assert old in file.read_text()
        file.write_text(file.read_text().replace(old, new))
    with served(tmp_path, *options) as server:
        began = time.monotonic()
        for folder in folders:
            (folder / "DELIVERED").touch()
        until(lambda: _ended(server) == NUMBER, 3000, server.process)
        wall_s = time.monotonic() - began
        assert _counted(server, "aerocal_runs") == _EXPECTED
        # The server is told after the records.
        until(lambda: not _counted(server, "aerocal_queue_runs"), 120, server.process)
        runs = server.runs(flow_runs={"tags": {"all_": ["delivery"]}})
        assert Counter(run["state_name"] for run in runs) == _EXPECTED
        assert {run["run_count"] for run in runs} == {1}
        # The last lines of an end are written after the server has been told.
        time.sleep(3)
        logs = [*(tmp_path / "state").rglob("*.log*"), tmp_path / "printed"]
        lines = [line for file in logs for line in file.read_text().splitlines()]
    assert len(logs) >= 3
    assert [line for line in lines if _WRONG.search(line)] == []
    assert [line for line in lines if not _DATED.match(line)] == []
    with capfd.disabled():
        print(f"\n{NUMBER} deliveries at once on {database} in {wall_s:.0f} s, {len(lines)} lines of logs")


def _ended(server: Served) -> int:
    runs = _counted(server, "aerocal_runs")
    return sum(number for state, number in runs.items() if state not in ("Scheduled", "Running"))


def _counted(server: Served, name: str) -> Counter[str]:
    """A figure of the production's metrics by state."""
    address = f"http://127.0.0.1:{server.overview}/metrics"
    asked = urllib.request.Request(address, headers={"Authorization": basic(server.password)})
    with urllib.request.urlopen(asked, timeout=60) as answer:
        families = list(text_string_to_metric_families(answer.read().decode()))
    (family,) = (one for one in families if one.name == name)
    counted: Counter[str] = Counter()
    for sample in family.samples:
        counted[sample.labels["state"]] += int(sample.value)
    return +counted
