"""The living line: stage, fraction and time left by what stages took before, or take in proportion."""

from __future__ import annotations

import io
import logging

import pytest
from rich.console import Console

from flows.command.living_line import LivingLine


class Clock:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


class Run:
    """A run of three stages of 1, 4 and 5 expected seconds."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.line = LivingLine({"read": 1.0, "compute": 4.0, "report": 5.0}, self.clock)

    def note(self, **what: str | float) -> None:
        self.line.emit(logging.makeLogRecord(what))

    def stage(self, name: str, seconds: float) -> None:
        self.note(stage_began=name)
        self.clock.now += seconds
        self.note(stage_ended=name)

    def shown(self) -> str:
        console = Console(file=io.StringIO(), force_terminal=True, width=100)
        console.print(self.line)
        assert isinstance(console.file, io.StringIO)
        return console.file.getvalue()


def test_fraction_and_time_left_follow_what_the_stages_were_expected_to_take() -> None:
    run = Run()
    run.stage("read", 1.0)
    run.note(stage_began="compute")
    run.clock.now += 2.0
    assert run.line.fraction == pytest.approx(0.3)
    assert run.line.seconds_left == pytest.approx(7.0)


def test_a_slower_machine_takes_longer_for_the_rest_in_proportion() -> None:
    run = Run()
    run.stage("read", 3.0)
    run.note(stage_began="compute")
    run.clock.now += 6.0
    assert run.line.fraction == pytest.approx(0.3)
    assert run.line.seconds_left == pytest.approx(21.0)


def test_a_reused_stage_is_no_work_and_none_is_done_before_it_ends() -> None:
    run = Run()
    run.note(stage_ended="read")
    run.note(stage_began="compute")
    run.clock.now += 100.0
    assert run.line.fraction == pytest.approx(0.95 * 4.0 / 9.0)
    run.note(stage_ended="compute")
    assert run.line.fraction == pytest.approx(4.0 / 9.0)


def test_the_line_is_there_after_five_seconds_and_says_stage_fraction_and_time_left() -> None:
    run = Run()
    run.stage("read", 1.0)
    run.note(stage_began="compute")
    run.clock.now += 3.0
    assert run.shown() == ""
    run.clock.now += 1.0
    shown = run.shown()
    for words in ("compute", "48 %", "about 5 s left"):
        assert words in shown


def test_a_stage_that_says_how_far_it_is_is_believed() -> None:
    run = Run()
    run.stage("read", 1.0)
    run.note(stage_began="compute")
    run.clock.now += 5.0
    run.note(stage_fraction=0.25)
    # 20 s of the stage instead of the 4 that were expected: 6 of 26 s are over.
    assert run.line.fraction == pytest.approx(6.0 / 26.0)
    assert run.line.seconds_left == pytest.approx(20.0)
    run.clock.now += 10.0
    assert run.line.fraction == pytest.approx(16.0 / 26.0)
