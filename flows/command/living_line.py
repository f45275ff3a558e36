"""The progress line of a run: its current stage, how much is done, and roughly how long the rest takes.

It is shown below the messages on a terminal after a run has taken some seconds. The durations of stages are
those of their last computation for the same output folder; for the first one, only their usual proportions
are known. The progress so far shows how fast this machine is. A stage may report its own progress
(`stage_fraction` of its messages).
"""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from tasks.store.store import Store

# Of the operational block (2,448 images, 545,000 image points), s; only their proportions matter.
_USUAL_S = {
    "import_image_points": 1.1,
    "approximate_values": 1.4,
    "bundle_adjustment": 8.0,
    "direct_georeferencing": 2.0,
    "report": 1.2,
}
_USUAL_OTHER_S = 0.1
_SHOWN_AFTER_S = 5.0
# What a stage that takes longer than expected is believed to have done.
_MOST = 0.95
_TIMES_PER_SECOND = 2


class LivingLine(logging.Handler):
    """Follows the stages by their messages, and shows their progress.

    Parameters
    ----------
    expected_s : expected duration of each remaining stage, or their proportions.
    clock : seconds.
    """

    def __init__(self, expected_s: Mapping[str, float], clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(logging.INFO)
        self._left = dict(expected_s)
        self._clock = clock
        self._start = self._stage_start = clock()
        self._stage: str | None = None
        self._done = self._took = 0.0

    def emit(self, record: logging.LogRecord) -> None:
        """Record the start, progress and end of a stage."""
        began, ended = (getattr(record, name, None) for name in ("stage_began", "stage_ended"))
        fraction: float | None = getattr(record, "stage_fraction", None)
        if began is not None:
            self._stage, self._stage_start = began, self._clock()
        elif ended is not None:
            expected = self._left.pop(ended, 0.0)
            # One that is reused was not a work.
            if self._stage == ended:
                self._done += expected
                self._took += self._clock() - self._stage_start
            self._stage = None
        elif fraction and self._stage is not None:
            took = self._clock() - self._stage_start
            # A little less than all: what comes after the last part is never told.
            self._left[self._stage] = took / min(fraction, _MOST) / self._pace()

    @property
    def fraction(self) -> float:
        """Fraction of the work that is done, 0 to 1."""
        done = self._done + self._in_work()
        return done / whole if (whole := self._done + sum(self._left.values())) > 0.0 else 0.0

    @property
    def seconds_left(self) -> float:
        """Time that the rest takes at the same pace, s."""
        return self._pace() * (sum(self._left.values()) - self._in_work())

    def __rich__(self) -> RenderableType:
        """The line; empty at first and between stages."""
        if self._stage is None or self._clock() - self._start < _SHOWN_AFTER_S:
            return Group()
        line = Table.grid(padding=(0, 2))
        left = f"about {max(round(self.seconds_left), 1):,} s left"
        bar = ProgressBar(total=1.0, completed=self.fraction, width=30)
        line.add_row(self._stage.replace("_", " "), bar, f"{100.0 * self.fraction:3.0f} %", left)
        return line

    def _pace(self) -> float:
        """Actual seconds for each expected second."""
        return self._took / self._done if self._done > 0.0 else 1.0

    def _in_work(self) -> float:
        """Part of the current stage that is done, in expected seconds."""
        if self._stage is None:
            return 0.0
        expected = self._left.get(self._stage, 0.0)
        return min((self._clock() - self._stage_start) / self._pace(), _MOST * expected)


def _expected_s(store: Store, stage: str) -> float:
    """How long a stage took last time, or usually takes."""
    seconds = (store.newest(stage) or {}).get("seconds")
    return float(seconds) if isinstance(seconds, int | float) else _USUAL_S.get(stage, _USUAL_OTHER_S)


@contextmanager
def living_line(console: Console, directory: Path, stages: Sequence[str]) -> Iterator[None]:
    """Show the line while this process runs the stages of a story for an output folder."""
    if not (sys.stderr.isatty() and console.is_interactive):
        yield
        return
    store = Store.of(directory)
    line = LivingLine({stage: _expected_s(store, stage) for stage in stages})
    log = logging.getLogger("aerocal")
    log.addHandler(line)
    try:
        with Live(
            line,
            console=console,
            transient=True,
            redirect_stdout=False,
            refresh_per_second=_TIMES_PER_SECOND,
        ):
            yield
    finally:
        log.removeHandler(line)
