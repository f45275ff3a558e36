"""Which cameras need a calibration: the one in force expires or ages, or the camera has drifted.

A camera is looked at with the mounting of its newest calibration. Calibrations of earlier mountings are
listed and never due: nobody flies with them any more.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import date, timedelta
from typing import Literal, TypeAlias

from tasks.errors import InputError
from tasks.nearest_name import did_you_mean
from tasks.registry.contents import Contents, StoredCalibration
from tasks.registry.drift import Drift, DriftLimits, by_day, drifts_of

ReasonKind: TypeAlias = Literal["none_in_force", "expired", "expires", "too_old", "drifted"]
#: The kinds as people say them.
KINDS: dict[ReasonKind, str] = {
    "none_in_force": "no approved calibration in force",
    "expired": "expired",
    "expires": "expires soon",
    "too_old": "too old",
    "drifted": "drifted",
}


@dataclass(frozen=True)
class DueLimits:
    """From when on a calibration is due.

    Attributes
    ----------
    within_days : an end so near counts.
    max_age_days : age, counted from the flight (else from the approval), at which a calibration no longer
        serves; None: at none.
    drift : how much a parameter may change.
    without : cameras that are not looked at, by name, body or lens.
    """

    within_days: int = 30
    max_age_days: int | None = 730
    drift: DriftLimits = field(default_factory=DriftLimits)
    without: tuple[str, ...] = ()


@dataclass(frozen=True)
class Reason:
    """Why a camera needs a calibration.

    Attributes
    ----------
    kind : for programs.
    sentence : for people.
    """

    kind: ReasonKind
    sentence: str


@dataclass(frozen=True)
class CameraDue:
    """A camera with one mounting, and whether it needs a calibration.

    Attributes
    ----------
    camera, product, mounting : in words.
    camera_key, mounting_key : for programs; see `tasks.registry.identity`.
    in_use : whether this is the mounting of the newest calibration; others are never due.
    newest : its newest calibration, whatever its state.
    in_force : the approved one that holds today; None: there is none.
    age_days : days since its flight, else since its approval.
    ends : the last day on which this or one approved to follow it serves; None: until further notice, or none
        is in force.
    drifts : the comparisons that were made.
    reasons : why it needs a calibration; none: it does not.
    """

    camera: str
    product: str
    mounting: str
    camera_key: str
    mounting_key: str
    in_use: bool
    newest: StoredCalibration
    in_force: StoredCalibration | None
    age_days: int | None
    ends: date | None
    drifts: tuple[Drift, ...]
    reasons: tuple[Reason, ...]

    @property
    def is_due(self) -> bool:
        """Whether it needs a calibration."""
        return bool(self.reasons)

    @property
    def sentences(self) -> tuple[str, ...]:
        """The reasons, each with the name of the camera."""
        return tuple(f"{self.camera}, {self.product}: {reason.sentence}" for reason in self.reasons)


def due_of(contents: Contents, today: date, limits: DueLimits) -> tuple[CameraDue, ...]:
    """Every camera of a registry with every mounting; the mounting in use first, cameras by name.

    Raises
    ------
    InputError
        If the registry was edited, or has none of the cameras that are to be left out.
    """
    contents.require_untouched()
    _require_known(contents, limits.without)
    found: list[CameraDue] = []
    for key in {item.camera.camera_key: None for item in contents.calibrations}:
        own = by_day([item for item in contents.calibrations if item.camera.camera_key == key])
        # A camera may have been renamed.
        if not {name for item in own for name in item.camera.names} & set(limits.without):
            found += _of_camera(own, today, limits)
    return tuple(sorted(found, key=lambda one: (one.camera, one.camera_key, not one.in_use)))


def _of_camera(own: Sequence[StoredCalibration], today: date, limits: DueLimits) -> Iterator[CameraDue]:
    drifts = drifts_of(own, limits.drift)
    for mounting in {item.camera.mounting_key: None for item in reversed(own)}:
        items = [item for item in own if item.camera.mounting_key == mounting]
        in_use = mounting == own[-1].camera.mounting_key
        held = _holder(items, today)
        camera = items[-1].camera
        yield CameraDue(
            camera.label,
            camera.product,
            camera.mounting,
            camera.camera_key,
            mounting,
            in_use,
            items[-1],
            held,
            None if held is None else (today - _born(held)).days,
            None if held is None else _end(items, held, limits.max_age_days),
            drifts if in_use else (),
            tuple(_reasons(items, drifts, today, limits)) if in_use else (),
        )


def _reasons(
    items: Sequence[StoredCalibration], drifts: Sequence[Drift], today: date, limits: DueLimits
) -> Iterator[Reason]:
    held, waiting = _holder(items, today), _waiting(items, today)
    if held is None:
        ended = [item.validity.end for item in items if item.validity is not None and item.validity.end]
        past = [end for end in ended if end < today]
        if past:
            yield Reason("expired", f"The last approved calibration ended on {max(past)}.{waiting}")
        else:
            yield Reason("none_in_force", f"No approved calibration is in force.{waiting}")
    else:
        age, end = (today - _born(held)).days, _end(items, held, limits.max_age_days)
        if limits.max_age_days is not None and age > limits.max_age_days:
            old = f"{age} days old, more than {limits.max_age_days}: it is of {_born(held)}"
            yield Reason("too_old", f"Calibration {held.id} is {old}.{waiting}")
        elif end is not None and (end - today).days <= limits.within_days:
            days = (end - today).days
            when = "today" if days == 0 else f"in {days} day{'s' * (days != 1)}"
            yield Reason("expires", f"The approved calibration is valid until {end}, {when}.{waiting}")
    for drift in drifts:
        if drift.has_drifted:
            yield Reason("drifted", f"{drift.sentence} {_SETTLE}")


_SETTLE = "Find the cause; a known cause is stated at the approval (--although)."


def _waiting(items: Sequence[StoredCalibration], today: date) -> str:
    """Calibrations to follow: approved for later, or a draft newer than all approved ones."""
    later = [item for item in items if item.validity is not None and item.validity.start > today]
    if later:
        first = min(later, key=lambda item: item.validity.start if item.validity else date.max)
        return f" Calibration {first.id} is approved {first.validity}."
    if items[-1].state == "draft":
        return f" Calibration {items[-1].id} is a draft: `aerocal registry show {items[-1].id}`."
    return ""


def _holder(items: Sequence[StoredCalibration], day: date) -> StoredCalibration | None:
    """The approved calibration in force on a day; approval ensures that there is at most one."""
    held = [item for item in items if item.validity is not None and item.validity.contains(day)]
    return held[-1] if held else None


def _born(item: StoredCalibration) -> date:
    """Day from which its age counts: the flight, otherwise the approval."""
    if item.flown is not None:
        return item.flown
    return date.fromisoformat((item.approval or item.events[0]).at[:10])


def _end(items: Sequence[StoredCalibration], held: StoredCalibration, max_age: int | None) -> date | None:
    """Last day on which a calibration, or those that follow it without a gap, are valid and young enough."""
    while True:
        ends = [] if held.validity is None or held.validity.end is None else [held.validity.end]
        if max_age is not None:
            ends.append(_born(held) + timedelta(days=max_age))
        if not ends:
            return None
        end = min(ends)
        if end == date.max:
            return end
        following = _holder(items, end + timedelta(days=1))
        too_old = (
            following is not None
            and max_age is not None
            and _born(following) + timedelta(days=max_age) <= end
        )
        if following is None or following is held or too_old:
            return end
        held = following


def _require_known(contents: Contents, names: Collection[str]) -> None:
    known = {name: None for item in contents.calibrations for name in item.camera.names}
    for name in names:
        if name not in known:
            raise InputError(f"There is no calibration of a camera '{name}'.", did_you_mean(name, known))
