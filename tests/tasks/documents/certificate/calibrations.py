"""Records of calibrations made from the tables of an adjustment, for certificates under test."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from pathlib import Path

import numpy as np
import pandas as pd

from tasks.calibration.record import (
    CalibratedCamera,
    CalibratedParameter,
    CalibrationFlight,
    CalibrationRecord,
)
from tasks.settings.project import Project
from tasks.store.artifact import Artifact, artifact_of
from tasks.tables.parquet import read_table

_OF_STRIPS = "gnss_strip_bias"


def record_of(
    tables: Mapping[str, Artifact], project: Project, sigma0: float, redundancy: int, **changes: object
) -> CalibrationRecord:
    """The record of an adjustment with one camera; `changes` replace parts of it."""
    ((name, camera),) = project.cameras.items()
    table = read_table(tables["parameters"])
    rows = table[~table["parameter"].str.startswith(_OF_STRIPS)]
    parameters = tuple(_parameter(row) for row in rows.to_dict("records"))
    images = read_table(tables["images"])
    assert camera.columns is not None
    assert camera.rows is not None
    assert camera.pixel_um is not None
    assert camera.focal_length_mm is not None
    heights = tuple(sorted({round(h, -2) for h in images.groupby("strip")["height_above_ground_m"].median()}))
    content: dict[str, object] = {
        "camera": CalibratedCamera(
            name=name,
            identity=camera.identity,
            columns=camera.columns,
            rows=camera.rows,
            pixel_um=camera.pixel_um,
            mount_deg=camera.mount_deg,
            calibration_axes_deg=camera.calibration_axes_deg,
        ),
        "parameters": parameters,
        "covariance": covariance_of(parameters, read_table(tables["correlations"])),
        "flight": CalibrationFlight(
            project=project.project.name,
            crs=project.project.crs,
            flown=date(2026, 9, 14),
            images=len(images),
            strips=int(images["strip"].nunique()),
            object_points=tables["object_points"].rows or 0,
            image_points=tables["image_points"].rows or 0,
            control_points=tables["control_residuals"].rows or 0,
            heights_m=heights,
            headings_deg=(0.0, 90.0, 180.0, 270.0),
            gsd_m=tuple(h * camera.pixel_um * 1e-3 / camera.focal_length_mm for h in heights),
        ),
        "sigma0": sigma0,
        "redundancy": redundancy,
        "verdict": "accepted",
        "inputs": {"control.csv": "ab" * 32, "image_points.csv": "0f" * 32, "exposures.csv": "5e" * 32},
        "software": {"aerocal": "0.1.0", "numpy": np.__version__},
    }
    return CalibrationRecord.model_validate({**content, **changes})


def _parameter(row: Mapping[object, object] | Mapping[str, object]) -> CalibratedParameter:
    given = {str(key): value for key, value in row.items()}
    value, change, sigma, prior = (
        float(str(given[name])) for name in ("value", "change", "sigma", "sigma_prior")
    )
    held = not np.isfinite(sigma)
    return CalibratedParameter(
        parameter=str(given["parameter"]),
        entity=str(given["entity"]),
        unit=str(given["unit"]),
        value=value,
        given=value - change,
        sigma=None if held else sigma,
        sigma_prior=prior if np.isfinite(prior) else None,
        status=str(given["status"]),
        verdict="held" if held else "determined",
    )


def covariance_of(
    parameters: tuple[CalibratedParameter, ...], correlations: pd.DataFrame
) -> tuple[tuple[float, ...], ...]:
    """Covariance matrix of the parameters with a σ, from their correlations."""
    estimated = [item for item in parameters if item.sigma is not None]
    place = {item.key: index for index, item in enumerate(estimated)}
    matrix = np.eye(len(estimated))
    for row in correlations.itertuples():
        one, other = (row.parameter_a, row.entity_a), (row.parameter_b, row.entity_b)
        if one in place and other in place:
            matrix[place[one], place[other]] = matrix[place[other], place[one]] = row.correlation
    sigma = np.array([item.sigma for item in estimated], dtype=np.float64)
    covariance = matrix * np.outer(sigma, sigma)
    return tuple(tuple(row) for row in (0.5 * (covariance + covariance.T)).tolist())


def written(record: CalibrationRecord, folder: Path) -> Artifact:
    """calibration.json of a record."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "calibration.json"
    path.write_text(record.text + "\n", encoding="utf-8")
    return artifact_of(path)
