"""The whole command, measured by stage."""

from __future__ import annotations

import pytest

from benchmarks.command import command
from benchmarks.workload import Workload


@pytest.mark.slow
def test_every_way_to_run_is_measured_and_its_phases_make_up_the_whole() -> None:
    records = command(Workload("tiny", 3, 6), runs=1)
    assert [record.name for record in records] == [
        f"command-tiny-{way}" for way in ("warm", "changed", "reused")
    ]
    for record in records:
        assert record.phases_s is not None
        assert record.phases_processor_s is not None
        assert sum(record.phases_s.values()) == pytest.approx(record.ours_s)
        assert sum(record.phases_processor_s.values()) == pytest.approx(record.processor_s)
    warm, _, reused = (record.phases_s["bundle_adjustment"] for record in records if record.phases_s)
    assert reused < 0.5 * warm
