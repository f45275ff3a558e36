"""All mistakes that the intersections of surveyed points reveal: units of length, heights, zones, names."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from adjust.approximate.intersection import intersect
from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.parameters import State
from tasks.block.block_input import SurveyedPoints
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_from_grid, local_from_map
from tasks.deliveries.length_units import METRES_PER_UNIT
from tasks.errors import InputError
from tasks.plausibility.control import LARGEST_UNDULATION_M
from tasks.plausibility.declared_accuracy import ExpectedIntersections
from tasks.plausibility.mistake import Mistake
from tasks.plausibility.orientation_slips import Delivered
from tasks.tables.places import places_of

_MARGIN = 3.0
# Less is not a mistake of units, zones or heights.
_NOTABLE_M = 5.0
_NOTABLE_SIGMAS = 5.0
_FOOT = METRES_PER_UNIT["ft"]
# Zones to both sides of the declared one.
_ZONES = (1, -1, 2, -2)
_MOST_MIXED = 6
_CODE = re.compile(r"EPSG:(\d+)", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Survey:
    """Surveyed points in the frames of the project and of the adjustment.

    Attributes
    ----------
    table : control_points.parquet.
    points : the same in local terms.
    names : of the object points that the rays are numbered by.
    map_frame, frame : of the project and of the adjustment.
    crs_of_exposures, crs_of_control : as declared, of all inputs of each kind; empty if they differ.
    is_grid : whether angles are counted from the axes of the map.
    """

    table: pd.DataFrame
    points: SurveyedPoints
    names: tuple[str, ...]
    map_frame: MapFrame
    frame: AdjustmentFrame
    crs_of_exposures: str
    crs_of_control: str
    is_grid: bool


@dataclass(frozen=True)
class _Trial:
    """One reading: its meaning, and how far points then are from their intersections."""

    what: str
    remedy: str
    declare: str
    intersected: Floats
    given: Floats


def diagnosed_control(
    delivered: Delivered, state: State, survey: Survey, expected: ExpectedIntersections
) -> list[Mistake]:
    """Mistakes that explain how far the intersections are from the surveyed points.

    Parameters
    ----------
    delivered : with the mistakes corrected that the tie points show.
    """
    row = places_of(survey.points.name, survey.names)
    usable = np.flatnonzero((row >= 0) & survey.points.complete)
    found = _intersected(delivered, state, len(survey.names))
    usable = usable[np.isfinite(found[row[usable]]).all(axis=1)]
    if len(usable) == 0:
        return []
    here, given = found[row[usable]], survey.points.x_in_local[usable]
    now = _miss(here, given)
    mistakes: list[Mistake] = []
    if now > max(_NOTABLE_M, _NOTABLE_SIGMAS * expected.sigma_m):
        trials = list(_trials(_Place(delivered, state, survey, usable, row[usable], here, given)))
        best = min(trials, key=lambda trial: _miss(trial.intersected, trial.given))
        left = _miss(best.intersected, best.given)
        if left * _MARGIN < now and left <= max(_NOTABLE_M, expected.limit_m):
            mistakes.append(Mistake(best.what, _evidence(trials, now), best.remedy, best.declare))
            here, given = best.intersected, best.given
    return [*mistakes, *_mixed_names(here, given, [survey.points.name[i] for i in usable], expected)]


def _intersected(delivered: Delivered, state: State, points: int) -> Floats:
    """(m, 3) intersections, NaN where rays do not intersect."""
    found = intersect(delivered.rays, delivered.state(state), points)
    return np.asarray(np.where(found.usable[:, None], found.object_point, np.nan))


def _miss(intersected: Floats, given: Floats) -> float:
    length = np.linalg.norm(intersected - given, axis=1)
    return float(np.median(length[np.isfinite(length)])) if np.isfinite(length).any() else float("inf")


def _evidence(trials: Sequence[_Trial], now: float) -> tuple[str, ...]:
    ranked = sorted((_miss(trial.intersected, trial.given), trial.what) for trial in trials)[:3]
    return (
        *(f"{left:,.1f} m: {what[0].lower()}{what[1:].rstrip('.')}" for left, what in ranked),
        f"{now:,.1f} m: as declared",
    )


@dataclass(frozen=True, eq=False)
class _Place:
    """Surveyed points in use and where rays meet, and how both change with another reading.

    Attributes
    ----------
    usable, row : (n,) the surveyed points in use and their object points.
    here, given : (n, 3) intersections and surveyed positions as declared.
    """

    delivered: Delivered
    state: State
    survey: Survey
    usable: np.ndarray
    row: np.ndarray
    here: Floats
    given: Floats

    @property
    def control(self) -> Floats:
        """(n, 3) surveyed positions in the map."""
        in_map: Floats = self.survey.table[["x_m", "y_m", "z_m"]].to_numpy(np.float64)
        return np.asarray(in_map[self.usable])

    @property
    def exposures(self) -> Floats:
        """(e, 3) positions of exposures in the map."""
        return self.delivered.given.x_in_map

    def control_at(self, in_map: Floats) -> Floats:
        """Surveyed positions if these were their map coordinates."""
        return local_from_map(self.survey.map_frame, self.survey.frame, in_map)

    def exposures_at(self, in_map: Floats, turn: Floats | None = None) -> Floats:
        """Intersections if these were the map coordinates of the exposures, their grid turned by an angle."""
        frame, map_frame = self.survey.frame, self.survey.map_frame
        own = self.delivered.given
        at = local_from_map(map_frame, frame, self.exposures)
        moved = replace(own, observed=own.observed + local_from_map(map_frame, frame, in_map) - at)
        if turn is not None:
            # The import added the convergence that the declared zone has there, and the true one has another.
            axes = local_from_grid(map_frame, frame, in_map) @ rotation.about_z(turn)
            moved = replace(moved, local_from_grid=axes)
        delivered = replace(self.delivered, given=moved)
        return np.asarray(_intersected(delivered, self.state, len(self.survey.names))[self.row])


def _trials(place: _Place) -> Iterator[_Trial]:
    """Every reading of exposures and control points."""
    yield from _heights(place)
    yield from _feet(place)
    yield from _exchanged(place)
    yield from _zones(place)


#: What is in feet: (x, y, z), words, key.
_FEET = (
    (np.array([1.0, 1.0, 1.0]), "coordinates", "length_unit"),
    (np.array([0.0, 0.0, 1.0]), "heights", "height_unit"),
)


def _heights(place: _Place) -> Iterator[_Trial]:
    """One height system is that of the ellipsoid, the other that of the geoid."""
    local_from_enu = np.asarray(place.survey.frame.local_from_enu(place.given))
    up = np.einsum("nji,nj->ni", local_from_enu, place.here - place.given)[:, 2]
    offset = float(np.median(up))
    if abs(offset) <= LARGEST_UNDULATION_M:
        yield _Trial(
            "The heights of exposures and control refer to different height systems (geoid undulation?): the "
            f"intersections are {abs(offset):.1f} m {'higher' if offset > 0.0 else 'lower'} than given.",
            "Check `heights` of both inputs: altitudes above the geoid need its grid.",
            'inputs.exposures.heights = { geoid = "FILE.tif" }  # or of inputs.control',
            place.here - offset * local_from_enu[:, :, 2],
            place.given,
        )


def _feet(place: _Place) -> Iterator[_Trial]:
    """Coordinates or heights of one of the two are in feet and read as metres, or the reverse."""
    for scale, words, key in _FEET:
        if not place.survey.map_frame.is_local and key != "height_unit":
            continue
        for unit, in_words, factor in (("ft", "feet", _FOOT), ("m", "metres", 1.0 / _FOOT)):
            factors = 1.0 + (factor - 1.0) * scale
            yield _Trial(
                f"The {words} of the control points look like {in_words}.",
                f'Declare {key} = "{unit}" for the control points ("us-ft" for US survey feet).',
                f'inputs.control.{key} = "{unit}"',
                place.here,
                place.control_at(place.control * factors),
            )
            yield _Trial(
                f"The {words} of the exposures look like {in_words}.",
                f'Declare {key} = "{unit}" for the exposures ("us-ft" for US survey feet).',
                f'inputs.exposures.{key} = "{unit}"',
                place.exposures_at(place.exposures * factors),
                place.given,
            )


def _exchanged(place: _Place) -> Iterator[_Trial]:
    map_frame = place.survey.map_frame
    exchanged = place.control[:, [1, 0, 2]]
    if map_frame.is_local or bool(np.asarray(map_frame.inside_area_of_use(exchanged)).all()):
        yield _Trial(
            "x and y of the control points look swapped.",
            "x is east and y is north in every input: exchange the two columns.",
            'inputs.control.columns = { x = "y", y = "x" }',
            place.here,
            place.control_at(exchanged),
        )


def _zones(place: _Place) -> Iterator[_Trial]:
    """One of the two is in a neighbouring zone; an input in the project's CRS is believed before another."""
    survey, map_frame = place.survey, place.survey.map_frame
    control_first = survey.crs_of_control != map_frame.name or survey.crs_of_exposures == map_frame.name
    if control_first:
        for crs, moved, _ in _in_other_zones(map_frame, survey.crs_of_control, place.control):
            zone = _zone("control", "control points", survey.crs_of_control, crs)
            yield _Trial(*zone, place.here, place.control_at(moved))
    if not control_first or survey.crs_of_exposures != map_frame.name:
        for crs, moved, turn in _in_other_zones(map_frame, survey.crs_of_exposures, place.exposures):
            zone = _zone("exposures", "exposures", survey.crs_of_exposures, crs)
            yield _Trial(*zone, place.exposures_at(moved, turn if survey.is_grid else None), place.given)


def _zone(kind: str, words: str, declared: str, crs: str) -> tuple[str, str, str]:
    return (
        f"The coordinates of the {words} look like those of another zone: {crs}, not {declared}.",
        f'Declare crs = "{crs}" for the {words}.',
        f'inputs.{kind}.crs = "{crs}"',
    )


def _in_other_zones(
    map_frame: MapFrame, declared: str, place: Floats
) -> Iterator[tuple[str, Floats, Floats]]:
    """Readings of coordinates (n, 3) of an input as of a neighbouring zone.

    Returns
    -------
    readings : the CRS, where the coordinates are in the project, and the angle (n,) by which angles from that
        grid are rotated relative to those from the declared one.
    """
    code = _CODE.fullmatch(declared)
    if code is None or map_frame.is_local:
        return
    source = MapFrame.of(declared, map_frame.heights)
    as_delivered = source.from_geodetic(map_frame.to_geodetic(place))
    for step in _ZONES:
        crs = f"EPSG:{int(code[1]) + step}"
        try:
            other = MapFrame.of(crs, map_frame.heights)
        except InputError:
            continue
        if _family(other) != _family(source):
            continue
        moved = map_frame.from_geodetic(other.to_geodetic(as_delivered))
        if np.isfinite(moved).all():
            declared_turn = map_frame.convergence(place) - source.convergence(as_delivered)
            turn = map_frame.convergence(moved) - other.convergence(as_delivered) - declared_turn
            yield crs, moved, np.asarray(turn)


def _family(frame: MapFrame) -> str:
    """Name of a CRS without its numbers: zones of one system differ in them only."""
    return re.sub(r"\d+", "#", frame.crs.name)


def _mixed_names(
    here: Floats, given: Floats, names: Sequence[str], expected: ExpectedIntersections
) -> list[Mistake]:
    """Points that lie where the rays of others intersect."""
    limit = max(_NOTABLE_M, _NOTABLE_SIGMAS * expected.sigma_m)
    offset = np.nanmedian(here - given, axis=0) if len(names) > _MOST_MIXED else 0.0
    distance = np.linalg.norm(here[:, None, :] - offset - given[None, :, :], axis=2)
    far = np.flatnonzero(np.diagonal(distance) > limit)
    nearest = np.argmin(distance, axis=1)
    mixed = [
        int(i)
        for i in far
        if distance[i, nearest[i]] <= limit and _MARGIN * distance[i, nearest[i]] < distance[i, i]
    ]
    if len(mixed) < 2 or len({int(nearest[i]) for i in mixed}) < len(mixed):
        return []
    pairs = ", ".join(f"{names[i]} lies at {names[nearest[i]]}" for i in mixed[:_MOST_MIXED])
    more = ", …" if len(mixed) > _MOST_MIXED else ""
    evidence = tuple(
        f"{distance[i, nearest[i]]:,.1f} m: rays of {names[i]} to the position of {names[nearest[i]]}; "
        f"{distance[i, i]:,.1f} m: to its own"
        for i in mixed[:_MOST_MIXED]
    )
    return [
        Mistake(
            f"The names of {len(mixed)} control points look mixed up: by its rays {pairs}{more}.",
            evidence,
            "Correct the names in the file of the control points, or in that of their image points.",
        )
    ]
