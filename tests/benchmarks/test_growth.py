"""Every phase by itself."""

from __future__ import annotations

import pytest

from benchmarks.growth import grow, phases
from benchmarks.workload import Workload, simulated


def test_every_phase_takes_some_time() -> None:
    seconds = phases(simulated(Workload("tiny", 3, 6)), threads=1)
    assert {"accumulation", "factorisation", "selected inverse", "redundancy numbers"} <= set(seconds)
    assert all(value > 0.0 for value in seconds.values())


@pytest.mark.slow
def test_a_size_is_measured_in_its_own_process_and_adjusted_completely() -> None:
    record = grow(Workload("tiny", 3, 6))
    assert record.name == "growth-tiny"
    assert record.images == 18
    assert record.report is not None
    assert record.tables_mib is not None
    assert record.tables_mib > 0.02
    assert record.processor_s is not None
    assert record.processor_s > 0.0
    assert record.phases_s is not None
    assert 0.0 < record.phases_s["tables"] < record.ours_s
    _, _, redundancy = record.report.partition("Σr ")
    found, _, expected = redundancy.partition(" of ")
    assert float(found) == float(expected)
