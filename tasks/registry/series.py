"""The parameters of one camera over its calibrations, which count as those of one even if they name two."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import date
from math import hypot

from tasks.quantities import COMPONENTS, entity_kind, entity_words
from tasks.registry.compatibility import OF_MOUNTING
from tasks.registry.contents import StoredCalibration
from tasks.registry.drift import by_day
from tasks.registry.history import Validity
from tasks.registry.identity import CameraBody, heads_of

#: Those that every camera has come first, the others in the order in which they are met.
_FIRST = tuple(name for name, item in COMPONENTS.items() if item.kind.entity_kind == "camera")
_DESCRIBED: tuple[tuple[str, Callable[[CameraBody], str]], ...] = (
    ("are of the camera", lambda camera: f"'{camera.name}'"),
    ("are of an image of", lambda camera: camera.image),
)


@dataclass(frozen=True)
class SeriesPoint:
    """One calibration of a parameter.

    Attributes
    ----------
    calibration : id of the record.
    flown : date of the flight.
    added : date on which it was added.
    value, sigma : in the unit of the series.
    state : of the record.
    validity : days on which it holds.
    mounting : in words.
    """

    calibration: int
    flown: date | None
    added: date
    value: float
    sigma: float
    state: str
    validity: Validity | None
    mounting: str

    @property
    def day(self) -> date:
        """Where it is in a series: the day of the flight, else that on which it was added."""
        return self.flown if self.flown is not None else self.added


@dataclass(frozen=True)
class ParameterSeries:
    """All calibrations of one parameter, by date; `head` is that of a rig, empty for the camera itself."""

    parameter: str
    unit: str
    points: tuple[SeriesPoint, ...]
    head: str = ""

    @property
    def words(self) -> str:
        """The parameter, with its head."""
        return entity_words(self.parameter, self.head)

    def change(self, index: int) -> tuple[float, float] | None:
        """Change from the calibration before, and its σ from both.

        None for the first one, and for boresight and lever arm of another mounting.
        """
        if index == 0:
            return None
        before, point = self.points[index - 1], self.points[index]
        if self.parameter in OF_MOUNTING and point.mounting != before.mounting:
            return None
        return point.value - before.value, hypot(point.sigma, before.sigma)


def series_of(items: Sequence[StoredCalibration]) -> tuple[ParameterSeries, ...]:
    """The series of every parameter determined by any calibration; heads are called as in the last one."""
    found: dict[tuple[str, str, str], list[SeriesPoint]] = {}
    newest = by_day(items)[-1]
    for item in items:
        heads = heads_of(item.record, newest.record)
        for one in item.record.estimated:
            own = one.entity in heads and entity_kind(one.parameter) == "camera"
            if own and one.sigma and one.verdict in ("determined", "weak"):
                key = (one.parameter, one.unit, heads[one.entity])
                found.setdefault(key, []).append(_point(item, one.value, one.sigma))
    keys = sorted(found, key=lambda key: _FIRST.index(key[0]) if key[0] in _FIRST else len(_FIRST))
    return tuple(
        ParameterSeries(
            key[0], key[1], tuple(sorted(found[key], key=lambda p: (p.day, p.calibration))), key[2]
        )
        for key in keys
    )


def _point(item: StoredCalibration, value: float, sigma: float) -> SeriesPoint:
    return SeriesPoint(
        item.id,
        item.flown,
        date.fromisoformat(item.events[0].at[:10]),
        value,
        sigma,
        item.state,
        item.validity,
        item.camera.mounting,
    )


def shared_numbers(items: Sequence[StoredCalibration]) -> Iterator[str]:
    """Sentences that two cameras may have one serial number; none if all name and describe one camera.

    Parameters
    ----------
    items : the calibrations of one camera, by its numbers; where it has none, by its name.
    """
    for words, described in _DESCRIBED:
        ids: dict[str, list[str]] = {}
        for item in items:
            ids.setdefault(described(item.camera), []).append(str(item.id))
        if len(ids) > 1:
            camera = items[-1].camera
            found = "; ".join(f"{', '.join(of)} {words} {what}" for what, of in ids.items())
            yield (
                f"Calibrations {found}. All count as those of one camera ({camera.numbers or camera.name}): "
                "they are compared, and an approval supersedes earlier ones. If there are two cameras, "
                f"correct cameras.{camera.name}.identity and calibrate again."
            )
