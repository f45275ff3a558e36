"""Exposures of all input files in the coordinate system of the project."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa

from adjust.arrays import Bools, Floats
from adjust.camera.interior import FrameCamera
from tasks.coordinates.conformality import refuse_distorted_angles
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.datum_change import Transfer
from tasks.coordinates.geoid_grid import refuse_damaged_geoid
from tasks.deliveries.angles_of_heads import of_the_body
from tasks.deliveries.declared_exposures import (
    with_declared_flights,
    with_declared_names,
    with_declared_solutions,
)
from tasks.deliveries.exposure_angles import (
    ConvertedAngles,
    body_rates,
    convert_angles,
    keep_their_axes,
    refuse_impossible_angles,
    unit_suspicion,
)
from tasks.deliveries.file_statement import about_stated_heights, refuse_other_statement
from tasks.deliveries.image_names import with_image_names
from tasks.deliveries.length_units import exposures_in_metres
from tasks.deliveries.map_adjustment import true_orientations
from tasks.deliveries.plan_position import about_map_as_local, refuse_outside_area, refuse_without_image
from tasks.deliveries.source_rows import (
    METRES,
    Places,
    SigmaRange,
    about_extra,
    about_missing_sigmas,
    joined,
    refuse_sigmas,
)
from tasks.deliveries.trajectory import exposures_of_trajectory
from tasks.deliveries.trajectory_path import TrajectoryPath
from tasks.formats.records import ExposureRecords
from tasks.formats.register import TRAJECTORY_FORMATS, read_exposures
from tasks.nearest_name import did_you_mean
from tasks.plain_text import some_of
from tasks.settings.inputs import ExposuresInput
from tasks.store.notes import Notes

ExposureColumns: TypeAlias = tuple[Mapping[str, Any], Mapping[str, pa.Array], Notes, Sequence[TrajectoryPath]]

# Names that a message lists.
# A datum change worse than this may show in the result and is said.
_NOTABLE_ACCURACY_M = 0.05
# From a thousandth of a second of arc to half a turn.
_ANGLES = {
    unit: SigmaRange(turn * 1e-9, 0.5 * turn, unit)
    for unit, turn in (("deg", 360.0), ("gon", 400.0), ("rad", 2.0 * np.pi))
}


@dataclass(frozen=True, slots=True, eq=False)
class _Converted:
    """One input in the project's coordinate system."""

    records: ExposureRecords
    camera: pa.Array
    position: Floats
    sigma_position: Floats
    angles: ConvertedAngles
    rates: Floats
    velocity: Floats
    kind: str
    problems: tuple[str, ...]
    path: TrajectoryPath | None


def exposure_columns(
    sources: Sequence[ExposuresInput],
    cameras: tuple[str, ...],
    project: MapFrame,
    frames: Mapping[str, FrameCamera] | None = None,
    heads: Mapping[str, Floats] | None = None,
) -> ExposureColumns:
    """Columns of ``exposures.parquet``, further columns of the files, notes, and the trajectories.

    Parameters
    ----------
    cameras : names of the cameras of the project.
    project : CRS and heights of the project.
    frames : the cameras themselves; needed for orientations that were adjusted in a map.
    heads : of `body_from_heads`; needed where cameras are heads of rigs.

    Raises
    ------
    InputError
        For a camera the project does not have, an image given twice, positions outside the CRS or the geoid
        grid, angles that cannot be in the declared unit or grid, standard deviations that are not positive.
    """
    inputs = [_converted(source, cameras, project, frames or {}, heads or {}) for source in sources]
    records = [entry.records for entry in inputs]
    places = Places.of_files([r.file for r in records], [r.line for r in records])
    image = pa.concat_arrays([r.image for r in records])
    codes = image.dictionary_encode().indices.to_numpy(zero_copy_only=False).astype(np.int64)
    places.refuse_duplicates(codes, "image", [image])
    columns: dict[str, Any] = {
        "image": image,
        "camera": pa.concat_arrays([entry.camera for entry in inputs]),
        "strip": pa.concat_arrays([r.strip for r in records]),
        "flight": pa.concat_arrays([r.flight for r in records]),
        "time_s": np.concatenate([r.time_s for r in records]),
        "event": pa.concat_arrays(
            [pa.nulls(len(r.line), pa.string()) if r.event is None else r.event for r in records]
        ),
        "position": [entry.kind for entry in inputs for _ in range(len(entry.position))],
    }
    angles = [entry.angles for entry in inputs]
    for suffix, arrays in (
        ("x_m y_m z_m", [entry.position for entry in inputs]),
        ("sigma_x_m sigma_y_m sigma_z_m", [entry.sigma_position for entry in inputs]),
        ("omega_deg phi_deg kappa_deg", [a.omega_phi_kappa for a in angles]),
        ("sigma_omega_deg sigma_phi_deg sigma_kappa_deg", [a.sigma_omega_phi_kappa for a in angles]),
        ("heading_deg pitch_deg roll_deg", [a.heading_pitch_roll for a in angles]),
        ("sigma_heading_deg sigma_pitch_deg sigma_roll_deg", [a.sigma_heading_pitch_roll for a in angles]),
        ("rate_roll_deg_s rate_pitch_deg_s rate_yaw_deg_s", [entry.rates for entry in inputs]),
        ("velocity_east_m_s velocity_north_m_s velocity_up_m_s", [entry.velocity for entry in inputs]),
    ):
        columns |= dict(zip(suffix.split(), np.concatenate(arrays).T, strict=True))
    problems = (*(problem for entry in inputs for problem in entry.problems), *about_extra(records))
    notes = Notes(problems, {"counts": {"exposures": len(image)}})
    extra = joined([r.extra for r in records], [len(r.line) for r in records])
    return columns, extra, notes, [entry.path for entry in inputs if entry.path is not None]


def _converted(
    source: ExposuresInput,
    cameras: tuple[str, ...],
    project: MapFrame,
    frames: Mapping[str, FrameCamera],
    heads: Mapping[str, Floats],
) -> _Converted:
    delivered, path = _delivered(source)
    delivered = with_image_names(delivered, source.image_names)
    records = with_declared_flights(with_declared_names(delivered, source), source.flights)
    records = with_declared_solutions(records, source)
    places = Places.of_files([records.file], [records.line])
    frame = MapFrame.of(source.crs, source.heights)
    if source.angles.reference == "grid":
        refuse_distorted_angles(frame)
    records = exposures_in_metres(records, source, frame)
    refuse_other_statement(source.file, records.states, source, frame, records.position)
    transfer = Transfer.between(frame, project)
    camera = _known_cameras(records, cameras, places)
    refuse_impossible_angles(records, source.angles, places)
    records = true_orientations(records, source, frame, camera, frames)
    records = of_the_body(records, source, camera, heads)
    refuse_sigmas(places, records.sigma_position, records.image, METRES)
    refuse_sigmas(places, records.sigma_angles, records.image, _ANGLES[source.angles.unit])
    refuse_outside_area(frame, records.position, places, records.image, "exposure")
    placed: Bools = np.asarray(np.isfinite(records.position).all(axis=1))
    position, sigma = np.full_like(records.position, np.nan), np.full_like(records.position, np.nan)
    position[placed] = transfer.positions(records.position[placed])
    refuse_without_image((frame, project), records.position, position, places, records.image)
    refuse_damaged_geoid(frame, records.position[placed])
    refuse_damaged_geoid(project, position[placed])
    _refuse_angles_of_no_place(records, source, transfer, placed, places)
    angles = convert_angles(
        records,
        source.angles,
        source.sigma.attitude_deg,
        transfer,
        _anywhere(records.position, placed),
        _anywhere(position, placed),
    )
    stated = np.where(np.isnan(records.sigma_position), source.sigma.position_m, records.sigma_position)
    sigma[placed] = turned_sigmas(transfer, stated[placed], records.position[placed], position[placed])
    problems = (
        unit_suspicion(records, source.angles),
        about_map_as_local(frame, records.position),
        _without_attitude(records),
        _without_position(records),
        _accuracy_note(transfer, records),
    )
    return _Converted(
        records,
        camera,
        position,
        sigma,
        angles,
        body_rates(records, source.angles),
        np.full_like(records.position, np.nan) if records.velocity is None else records.velocity,
        source.position,
        (
            *records.remarks,
            *about_stated_heights(source.file, records.states, source.heights),
            *(problem for problem in problems if problem is not None),
            *about_missing_sigmas(
                records.file,
                np.hstack([records.sigma_position, records.sigma_angles]),
                np.hstack([np.isfinite(records.position), np.isfinite(records.angles)]),
                "sigma.position_m and sigma.attitude_deg",
            ),
        ),
        None if path is None else path.in_project(transfer),
    )


def _delivered(source: ExposuresInput) -> tuple[ExposureRecords, TrajectoryPath | None]:
    """The exposures of a file, and the trajectory they were taken from."""
    if source.format in TRAJECTORY_FORMATS:
        return exposures_of_trajectory(source)
    records = read_exposures(source.format, source.file, source.angles.order, source.layout, source.rigs)
    return records, None


def turned_sigmas(transfer: Transfer, sigma: Floats, position: Floats, converted: Floats) -> Floats:
    """Standard deviations (n, 3) along the axes of the project: diagonal of R Σ Rᵀ."""
    level = sigma[:, 0] == sigma[:, 1]
    if transfer.is_identity or bool(np.all(level)):
        return sigma
    rotation = transfer.target_grid_from_source_grid(position, converted)
    return np.asarray(np.sqrt(np.einsum("nij,nj->ni", rotation**2, sigma**2)))


def _known_cameras(records: ExposureRecords, cameras: tuple[str, ...], places: Places) -> pa.Array:
    """Camera of each row; the project's only one where the file names none."""
    camera = records.camera
    if camera.null_count:
        if len(cameras) > 1:
            places.refuse(
                camera.is_null().to_numpy(zero_copy_only=False),
                records.image,
                "The exposure has no camera, but the project has several.",
                'Write camera = "NAME" in this input of the project file, or add a camera column.',
            )
        camera = camera.fill_null(cameras[0])
    encoded = camera.dictionary_encode()
    names = encoded.dictionary.to_pylist()
    unknown = np.array([name not in cameras for name in names])
    wrong = unknown[encoded.indices.to_numpy(zero_copy_only=False)]
    if wrong.any():
        row = int(np.argmax(wrong))
        name = camera[row].as_py()
        raise places.error(
            row,
            f"The camera '{name}' is not in the project file ({int(wrong.sum())} exposures name it or "
            "another unknown one).",
            f'Add a table [cameras."{name}"], or correct the name. {did_you_mean(name, cameras)}',
            str(records.image[row]),
        )
    return camera


def _without_attitude(records: ExposureRecords) -> str | None:
    """A sentence that counts the exposures without angles."""
    count = int(np.isnan(records.angles).all(axis=1).sum())
    if count == 0:
        return None
    return (
        f"{records.file.name}: {count:,} exposures have no attitude. Approximate attitudes are computed "
        "from the image points, without INS observations."
    )


def _without_position(records: ExposureRecords) -> str | None:
    """A sentence that counts the exposures without position."""
    missing = np.flatnonzero(np.isnan(records.position).all(axis=1))
    if len(missing) == 0:
        return None
    return (
        f"{records.file.name}: {len(missing):,} exposures have no position "
        f"({some_of(records.image.take(pa.array(missing)))}). Approximate positions are computed from "
        "the image points, without GNSS observations."
    )


def _anywhere(position: Floats, placed: Bools) -> Floats:
    """Positions (n, 3) with an arbitrary one for each unknown one: results computed there are not used."""
    somewhere = position[placed].mean(axis=0) if placed.any() else np.zeros(3)
    return np.where(placed[:, None], position, somewhere)


def _refuse_angles_of_no_place(
    records: ExposureRecords, source: ExposuresInput, transfer: Transfer, placed: Bools, places: Places
) -> None:
    """Refuse angles that must be converted to other axes at an unknown position."""
    lost = np.isfinite(records.angles).all(axis=1) & ~placed
    if transfer.source.is_local or keep_their_axes(source.angles, transfer):
        return
    places.refuse(
        lost,
        records.image,
        "The exposure has angles but no position, without which they cannot be converted to the axes of "
        f"the project ({int(lost.sum())} exposures).",
        "Give its position, leave its angles empty, or deliver ω, φ, κ about the grid of the project's CRS.",
    )


def _accuracy_note(transfer: Transfer, records: ExposureRecords) -> str | None:
    if transfer.keeps_datum:
        return None
    accuracy = transfer.accuracy_m
    if accuracy is not None and accuracy <= _NOTABLE_ACCURACY_M:
        return None
    stated = "unknown" if accuracy is None else f"{accuracy:g} m"
    return (
        f"{records.file.name}: the positions are transformed to another datum ({transfer.description}), "
        f"with a published accuracy of {stated}. This may cause a constant difference from the control "
        "points."
    )
