"""The record of one camera or rig, from the results of a calibration for all of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date

import numpy as np
import pandas as pd

from adjust.calibration.flight_pattern import FlightPattern
from adjust.rig import OF_HEADS
from tasks.calibration.head_boresight import OF_REFERENCE, HeadBoresight
from tasks.calibration.held_quantities import WithHeld
from tasks.calibration.record import (
    CalibratedCamera,
    CalibratedParameter,
    CalibrationFlight,
    CalibrationRecord,
)
from tasks.calibration.verdicts import FlightVerdict, ParameterVerdict
from tasks.quantities import is_calibrated, kind_of
from tasks.settings.cameras import CameraInput
from tasks.tables.covariance import Key, correlation_pairs, covariance_of, sigmas_of


@dataclass(frozen=True)
class Origin:
    """Origin of every record.

    Attributes
    ----------
    project, crs, flown : of the project file.
    counts : numbers of object points, image points and control points.
    inputs : SHA-256 of each input file by name.
    software : versions.
    sigma0, redundancy : of the adjustment.
    remarks : sentences about the whole calibration.
    """

    project: str
    crs: str
    flown: date | None
    counts: Mapping[str, int]
    inputs: Mapping[str, str]
    software: Mapping[str, str]
    sigma0: float
    redundancy: int
    remarks: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Found:
    """What a calibration has found.

    Attributes
    ----------
    known : parameters, correlations, what was held.
    verdicts : of each parameter.
    of_flight : of the whole.
    pattern : heights and directions of the flight.
    images, cameras : images.parquet and cameras.parquet.
    boresights : of the heads of rigs.
    """

    known: WithHeld
    verdicts: Mapping[Key, ParameterVerdict]
    of_flight: FlightVerdict
    pattern: FlightPattern
    images: pd.DataFrame
    cameras: pd.DataFrame
    boresights: Mapping[str, HeadBoresight]


def bodies(cameras: pd.DataFrame, images: pd.DataFrame) -> tuple[tuple[str, ...], ...]:
    """Names of the cameras of each record: a single camera, or the reference head and the other heads.

    Parameters
    ----------
    cameras, images : the tables of these names; without images in the block, it is a reference head.
    """
    taken = cameras[cameras["camera"].isin(images["camera"])]
    body = taken["head_of"].where(taken["head_of"].notna(), taken["camera"])
    return tuple(
        (str(name), *sorted(map(str, set(own) - {name}))) for name, own in taken.groupby(body)["camera"]
    )


def record_of(
    found: Found, names: tuple[str, ...], given: Mapping[str, CameraInput], origin: Origin
) -> CalibrationRecord:
    """The record of a camera, or of the heads of a rig together.

    The errors of the heads of a rig are correlated: separately, σ of their differences would be wrong.

    Parameters
    ----------
    names : of `bodies`.
    given : cameras of the project file.
    """
    rows = rows_of(found.known.parameters, names)
    camera, *heads = (_camera(found.cameras, name, given[name]) for name in names)
    mountings = tuple(found.boresights[name].sentence(name) for name in names if name in found.boresights)
    return CalibrationRecord(
        camera=camera,
        heads=tuple(heads),
        parameters=_parameters(found, rows),
        covariance=_covariance(found, rows),
        held=found.known.held,
        flight=_flight(found, names, origin),
        sigma0=origin.sigma0,
        redundancy=origin.redundancy,
        verdict=found.of_flight.verdict,
        reasons=found.of_flight.reasons,
        restrictions=found.of_flight.restrictions,
        remarks=(*mountings, *found.of_flight.remarks, *origin.remarks),
        inputs=dict(origin.inputs),
        software=dict(origin.software),
    )


def rows_of(parameters: pd.DataFrame, names: tuple[str, ...]) -> pd.DataFrame:
    """Parameters of cameras and of the flights; those of strips are random and not part of a record.

    Boresight and lever arm of a head are those of the reference head, the first of `names`; this has no
    place relative to itself.
    """
    own = parameters["camera"].isna() | parameters["camera"].isin(names)
    rows = parameters[own & parameters["parameter"].map(is_calibrated)]
    kind = rows["parameter"].map(kind_of)
    of_reference = rows["camera"].isin(names[1:]) & kind.isin(OF_REFERENCE)
    of_heads = (rows["camera"] == names[0]) & kind.isin(OF_HEADS if len(names) > 1 else ())
    return rows[~of_reference & ~of_heads]


def _camera(cameras: pd.DataFrame, name: str, given: CameraInput) -> CalibratedCamera:
    (row,) = cameras[cameras["camera"] == name].to_dict("records")
    return CalibratedCamera(
        name=name,
        identity=given.identity,
        columns=int(row["columns"]),
        rows=int(row["rows"]),
        pixel_um=float(row["pixel_um"]),
        mount_deg=int(row["mount_deg"]),
        calibration_axes_deg=int(row["calibration_axes_deg"]),
    )


def _parameters(found: Found, rows: pd.DataFrame) -> tuple[CalibratedParameter, ...]:
    return tuple(
        CalibratedParameter(
            parameter=row["parameter"],
            entity=row["entity"],
            unit=row["unit"],
            value=row["value"],
            given=row["value"] - row["change"],
            sigma=_finite(row["sigma"]),
            sigma_prior=_finite(row["sigma_prior"]),
            status=row["status"],
            verdict=verdict.verdict,
            because=verdict.because,
        )
        for row in rows.to_dict("records")
        for verdict in (found.verdicts[row["parameter"], row["entity"]],)
    )


def _covariance(found: Found, rows: pd.DataFrame) -> tuple[tuple[float, ...], ...]:
    rows = rows[rows["sigma"].notna()]
    keys: list[Key] = list(zip(rows["parameter"], rows["entity"], strict=True))
    matrix = covariance_of(keys, sigmas_of(rows), correlation_pairs(found.known.correlations))
    return tuple(tuple(float(value) for value in row) for row in matrix)


def _flight(found: Found, names: tuple[str, ...], origin: Origin) -> CalibrationFlight:
    images = found.images[found.images["camera"].isin(names)]
    (row,) = found.cameras[found.cameras["camera"] == names[0]].to_dict("records")
    heights = tuple(round(float(height), 1) for height in found.pattern.heights)
    headings = (round(float(np.rad2deg(angle)) % 360.0, 1) for angle in found.pattern.directions)
    pixel_over_c = 1e-3 * row["pixel_um"] / row["focal_length_mm"]
    return CalibrationFlight(
        project=origin.project,
        crs=origin.crs,
        flown=origin.flown,
        images=len(images),
        strips=len(images[["flight", "strip"]].drop_duplicates()),
        heights_m=heights,
        headings_deg=tuple(headings),
        gsd_m=tuple(float(f"{height * pixel_over_c:.3g}") for height in heights),
        **origin.counts,
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
