"""Settings of exposures that are taken from a trajectory: its clock and accuracy, and the events."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, Field, model_validator

from tasks.formats.register import EVENT_FORMATS
from tasks.formats.trajectory_records import Clock
from tasks.settings.base import InputPath, Settings, one_of, trouble
from tasks.settings.coordinates import NotNegative, Positive, PositiveTriple
from tasks.settings.table_layout import TableSettings

ClockName: TypeAlias = Literal["gps-week", "gps-day", "gps-date", "utc-week", "utc-day", "utc-date"]
CLOCKS: dict[ClockName, Clock] = {
    "gps-week": Clock("gps", "week"),
    "gps-day": Clock("gps", "day"),
    "gps-date": Clock("gps", "date"),
    "utc-week": Clock("utc", "week"),
    "utc-day": Clock("utc", "day"),
    "utc-date": Clock("utc", "date"),
}
SolutionName: TypeAlias = Literal["fixed", "ppp", "float", "dgps", "sbas", "single"]
SolutionUse: TypeAlias = Literal["leave-out"] | PositiveTriple
_CLOCK_WORDS = (
    "`gps-…` is GPS time, `utc-…` is UTC; `…-week` and `…-day` count seconds of the week (from Sunday 0 h) "
    "and of the day, `…-date` is a date with a time"
)


class EventsInput(TableSettings):
    """The times of the exposures, at which a trajectory is interpolated."""

    file: InputPath
    """The file."""
    format: Annotated[str, AfterValidator(one_of(EVENT_FORMATS, "format of events"))] = "csv"
    """`csv` (image, time [, camera, strip, flight]; other headings can be declared) or `dji-mrk`."""
    time: ClockName | None = Field(
        default=None, description=f"Clock of the times; needed with `csv`. {_CLOCK_WORDS}."
    )
    outside: Literal["refuse", "leave-out"] = "refuse"
    """Treatment of events before, after, or in a gap of the trajectory. `leave-out`: these exposures have
    neither position nor attitude. A trajectory is never extrapolated.
    """

    @model_validator(mode="after")
    def _one_clock(self) -> EventsInput:
        if self.format == "csv" and self.time is None:
            raise trouble("The clock of the event times is not declared.", 'Declare e.g. time = "gps-week".')
        if self.format != "csv" and self.time is not None:
            raise trouble("The file of the events states its clock itself.", "Leave time out.")
        return self

    def _given_in_another_way(self) -> tuple[str, ...]:
        return ()


class TrajectoryInput(Settings):
    """Declarations that a trajectory file does not contain."""

    time: Literal["gps-week", "gps-day", "utc-week", "utc-day"] | None = Field(
        default=None, description=f"Clock of the trajectory; needed with `sbet`. {_CLOCK_WORDS}."
    )
    accuracy: InputPath | None = None
    """Accuracies of the trajectory (smrmsg), on its clock; the σ of an exposure are interpolated in them."""
    longest_gap_s: Positive | None = None
    """Longest interval between two samples within which a position is interpolated, s. Default: 2.5 median
    intervals.
    """
    gps_minus_utc_s: NotNegative | None = None
    """Leap seconds between GPS time and UTC; needed if trajectory and events are on different scales. 18 s
    since 2017.
    """
