"""The state of a registry's cameras on a day, as plain data: for the production page and for programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import date

from tasks.files.json_text import JSON, attributes
from tasks.registry.contents import Contents, StoredCalibration
from tasks.registry.drift import Against, Drift
from tasks.registry.due import CameraDue, DueLimits, due_of
from tasks.registry.series import ParameterSeries, series_of


@dataclass(frozen=True)
class Band:
    """Limits within which the newest calibration of a parameter should lie.

    Attributes
    ----------
    against : the older calibration it is compared with: the one before, or the first of the mounting.
    calibration : its id.
    lower, upper : limits, in the unit of the series.
    exceeded : whether the newest lies outside.
    """

    against: Against
    calibration: int
    lower: float
    upper: float
    exceeded: bool


@dataclass(frozen=True)
class WatchedSeries:
    """One parameter of one camera over its calibrations, with the values the newest one is compared with.

    Attributes
    ----------
    camera, product, camera_key : whose it is, as of `CameraDue`.
    series : the values with σ, day, state and mounting.
    bands : the limits; none for a parameter with a single calibration.
    """

    camera: str
    product: str
    camera_key: str
    series: ParameterSeries
    bands: tuple[Band, ...]


@dataclass(frozen=True)
class RegistryWatch:
    """The cameras of a registry on one day.

    Attributes
    ----------
    today : the day.
    cameras : every camera with every mounting.
    series : every parameter of the cameras that are checked.
    """

    today: date
    cameras: tuple[CameraDue, ...]
    series: tuple[WatchedSeries, ...]

    @property
    def due(self) -> tuple[CameraDue, ...]:
        """The cameras that need a calibration."""
        return tuple(one for one in self.cameras if one.is_due)

    @property
    def sentences(self) -> tuple[str, ...]:
        """Why, camera by camera; if none is due, a sentence that says so."""
        said = tuple(sentence for one in self.due for sentence in one.sentences)
        count = len({one.camera_key for one in self.cameras})
        return said or (f"No calibration is due: {count} camera{'s' * (count != 1)} checked.",)


def watch_of(contents: Contents, today: date, limits: DueLimits) -> RegistryWatch:
    """Examine every camera of a registry.

    Raises
    ------
    InputError
        As of `tasks.registry.due.due_of`.
    """
    cameras = due_of(contents, today, limits)
    series = tuple(
        watched
        for one in cameras
        if one.in_use
        for watched in _series(one, contents.sisters(one.newest.camera))
    )
    return RegistryWatch(today, cameras, series)


def _series(one: CameraDue, items: Sequence[StoredCalibration]) -> list[WatchedSeries]:
    return [
        WatchedSeries(one.camera, one.product, one.camera_key, series, _bands(series, one.drifts))
        for series in series_of(items)
    ]


def _bands(series: ParameterSeries, drifts: Sequence[Drift]) -> tuple[Band, ...]:
    return tuple(
        Band(
            drift.against, drift.old.id, found.old - found.limit, found.old + found.limit, found.exceeds
        )
        for drift in drifts
        for found in drift.parameters
        if (found.change.parameter, found.change.unit, found.change.head)
        == (series.parameter, series.unit, series.head)
    )  # fmt: skip


def as_json(watch: RegistryWatch) -> dict[str, JSON]:
    """The whole for programs; days as ISO 8601, units as in the records."""
    return {
        "today": watch.today.isoformat(),
        "due": [one.camera for one in watch.due],
        "cameras": [_camera_json(one) for one in watch.cameras],
        "series": [_series_json(one) for one in watch.series],
    }


def _camera_json(one: CameraDue) -> JSON:
    held = one.in_force
    names = ("camera", "product", "mounting", "camera_key", "mounting_key", "in_use", "age_days", "ends")
    return {
        **attributes(one, *names),
        "newest": one.newest.id,
        "in_force": None if held is None else held.id,
        "flown": None if held is None else _iso(held.flown),
        "due": one.is_due,
        "reasons": [attributes(reason, "kind", "sentence") for reason in one.reasons],
        "drifts": [_drift_json(drift) for drift in one.drifts],
    }


def _drift_json(drift: Drift) -> JSON:
    return {
        "new": drift.new.id,
        "old": drift.old.id,
        **attributes(drift, "against", "chi2_limit"),
        **attributes(drift.test, "chi2", "degrees_of_freedom", "probability"),
        "drifted": drift.has_drifted,
        "parameters": [
            {
                **attributes(one.change, "parameter", "unit", "head", "change", "sigma"),
                "limit": one.limit,
                "exceeded": one.exceeds,
            }
            for one in drift.parameters
        ],
    }


def _series_json(one: WatchedSeries) -> JSON:
    return {
        **attributes(one, "camera", "product", "camera_key"),
        **attributes(one.series, "parameter", "unit", "head"),
        "points": [
            {
                **attributes(point, "calibration", "day", "value", "sigma", "state", "mounting"),
                "valid_from": None if point.validity is None else point.validity.start.isoformat(),
                "valid_to": None if point.validity is None else _iso(point.validity.end),
            }
            for point in one.series.points
        ],
        "bands": [asdict(band) for band in one.bands],
    }


def _iso(day: date | None) -> str | None:
    return None if day is None else day.isoformat()
