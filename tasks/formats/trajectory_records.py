"""What readers of trajectories, of their accuracies and of events return.

A trajectory is a series of samples on a clock; events are the times of the exposures on a clock. Which
clocks these are the files mostly do not say: the project file declares it
(`tasks.deliveries.trajectory_window`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeAlias

import pyarrow as pa
from numpy.typing import NDArray

from tasks.formats.records import FileStatement, Floats, Lines

#: Kinds of GNSS solutions, the best first; an integer column counts them.
SOLUTIONS = ("fixed", "ppp", "float", "dgps", "sbas", "single", "none")
#: What a time counts: seconds of the week or of the day, or since 6 January 1980 (a date with a time).
Count: TypeAlias = Literal["week", "day", "date"]


@dataclass(frozen=True, slots=True)
class Clock:
    """The scale of times and their origin.

    Attributes
    ----------
    scale : GPS time, or UTC, which is behind it by the leap seconds.
    count : of the seconds.
    """

    scale: Literal["gps", "utc"]
    count: Count

    def __str__(self) -> str:
        return f"{'GPS time' if self.scale == 'gps' else 'UTC'}, seconds of the {self.count}"


@dataclass(frozen=True, slots=True, eq=False)
class TrajectoryRecords:
    """n samples in order of time.

    Attributes
    ----------
    file : the file they came from.
    clock : as the file states it; None: it does not.
    time_s : (n,) ascending, also over the end of a week or day.
    position : (n, 3) longitude, latitude (degrees), ellipsoidal height (m).
    velocity : (n, 3) east, north, up, m/s; None: not given.
    angles, rates : (n, 3) heading, pitch, roll, radians; of the body about its axes forward, right, down,
        radians per second; None: not given.
    sigma_position : (n, 3) east, north, up, m; None: not given.
    solution : (n,) index into `SOLUTIONS`; None: not given.
    states : what the file itself says of its numbers.
    """

    file: Path
    clock: Clock | None
    time_s: Floats
    position: Floats
    velocity: Floats | None = None
    angles: Floats | None = None
    rates: Floats | None = None
    sigma_position: Floats | None = None
    solution: NDArray[Any] | None = None
    states: FileStatement = field(default_factory=FileStatement)


@dataclass(frozen=True, slots=True, eq=False)
class AccuracyRecords:
    """Standard deviations of a trajectory, on its clock.

    Attributes
    ----------
    file : the file they came from.
    time_s : (n,) ascending, also over the end of a week or day.
    sigma_position : (n, 3) east, north, up, m.
    sigma_angles : (n, 3) heading, pitch, roll, radians.
    """

    file: Path
    time_s: Floats
    sigma_position: Floats
    sigma_angles: Floats


@dataclass(frozen=True, slots=True, eq=False)
class EventRecords:
    """Moments of exposures.

    Attributes
    ----------
    file : the file they came from.
    clock : as the file states it; None: it does not.
    image, camera, strip, flight : names, text (n,); null where the row gives none.
    time_s : (n,) seconds.
    line : (n,) 1-based line of each row.
    from_antenna : (n, 3) east, north, up, metres from the antenna to the camera; None: not given.
    extra : further columns of the file, text (n,), verbatim.
    """

    file: Path
    clock: Clock | None
    image: pa.Array
    camera: pa.Array
    strip: pa.Array
    flight: pa.Array
    time_s: Floats
    line: Lines
    from_antenna: Floats | None = None
    extra: Mapping[str, pa.Array] = field(default_factory=dict)
