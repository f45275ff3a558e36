"""The table of a sweep: one row of figures for each scenario."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from tasks.deliveries.cameras import frame_cameras
from tasks.files.json_text import JSON, json_text
from tasks.results.figures import figures_of
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, read_notes, write_notes
from tasks.store.store import stored
from tasks.sweep.scenario import Computed, failures
from tasks.tables.parquet import read_table, write_stage_table
from tasks.tables.schemas.sweep import SWEEP

Figure = str | float | int | None
Row = dict[str, Figure]

_AXES = ("x", "y", "z")
_TOOK_PART = ("used", "uncontrolled")
_NOT_ESTIMATED = ("considered", "eliminated", "fixed", "not_determinable")
#: Numbers that the notes of an adjustment have under the same name.
_FIGURES = ("sigma0", "sigma0_um", "redundancy", "iterations")
_COUNTS = {
    "images": "images",
    "object_points": "object_points",
    "image_points": "image_points",
    "rejected": "rejected",
    "control": "control_points",
    "check": "check_points",
}


@stored("sweep_table")
def tabulate_sweep(folder: Path, *, computed: tuple[Computed, ...]) -> None:
    """Write sweep.parquet and, as problems, which scenarios have no result."""
    rows = [_row(one, number) for number, one in enumerate(computed, start=1)]
    table = pd.DataFrame(rows, columns=[column.name for column in SWEEP.columns])
    table["sigma0"] = table["sigma0"].astype(np.float64)
    first = table.groupby(["block", "control"])["sigma0"].transform(lambda column: column.iloc[0])
    table["sigma0_ratio"] = table["sigma0"] / first
    write_stage_table(folder, SWEEP, table)
    write_notes(folder, Notes(tuple(failures(computed))))


def _row(computed: Computed, number: int) -> Row:
    scenario = computed.scenario
    row: Row = {
        "block": scenario.block,
        "control": scenario.control,
        "variant": scenario.variant,
        "number": number,
        "changes": json_text(cast(JSON, dict(scenario.changes))),
        "status": computed.status,
        "reason": computed.reason,
    }
    if computed.error is not None:
        return row
    artifacts = computed.artifacts
    return {
        **row,
        **_figures(artifacts["notes"]),
        **_parameters(read_table(artifacts["parameters"])),
        **_image_residuals(read_table(artifacts["residuals"])),
        **_mean_residuals(artifacts["notes"]),
        "gsd_m": _gsd_m(read_table(artifacts["images"]), read_table(artifacts["cameras"])),
        **_differences("control", read_table(artifacts["control_residuals"]).query("status == 'used'")),
        **_differences("check", read_table(artifacts["check_points"])),
    }


def _figures(notes: Artifact) -> Row:
    figures = read_notes(notes).figures
    counts = cast(Mapping[str, JSON], figures["counts"])
    row: Row = {name: cast(Figure, figures[name]) for name in _FIGURES}
    return row | {column: cast(Figure, counts[name]) for name, column in _COUNTS.items()}


def _parameters(parameters: pd.DataFrame) -> Row:
    """How many additional parameters (names SET:NAME) were offered, kept, significant."""
    additional = parameters.loc[parameters["parameter"].str.contains(":"), "status"]
    return {
        "parameters_offered": len(additional),
        "parameters_kept": int((~additional.isin(_NOT_ESTIMATED)).sum()),
        "parameters_significant": int((additional == "significant").sum()),
    }


def _image_residuals(residuals: pd.DataFrame) -> Row:
    own = residuals[(residuals["group"] == "image_points") & residuals["status"].isin(_TOOK_PART)]
    return {
        f"image_rms_{axis}_um": _rms(own.loc[own["component"] == axis, "residual"].to_numpy(np.float64))
        for axis in ("x", "y")
    }


def _mean_residuals(notes: Artifact) -> Row:
    """The size of the mean residuals in sub-areas of the images, over all cameras."""
    cameras = figures_of(read_notes(notes).figures).residual_grid.cameras
    row: Row = {
        "cells": sum(camera.known for camera in cameras),
        "cells_significant": sum(camera.significant for camera in cameras),
        "cells_by_chance": sum(camera.expected_by_chance for camera in cameras),
    }
    for index, axis in enumerate(("x", "y")):
        signals = [camera.signal_um[index] for camera in cameras]
        row[f"systematic_{axis}_um"] = _rms(np.array(signals, dtype=np.float64))
    return row


def _gsd_m(images: pd.DataFrame, cameras: pd.DataFrame) -> float | None:
    """Median over the images that are used."""
    of_camera = {
        name: camera.pixel_size / camera.focal_length for name, camera in frame_cameras(cameras).items()
    }
    gsd = images["height_above_ground_m"] * images["camera"].map(of_camera).astype(np.float64)
    known = gsd.dropna()
    return float(known.median()) if len(known) else None


def _differences(role: str, table: pd.DataFrame) -> Row:
    """RMS and largest difference, and for check points the RMS of what was predicted."""
    row: Row = {}
    for axis in _AXES:
        difference = table[f"d{axis}_m"].to_numpy(np.float64)
        row[f"rmse_{role}_{axis}_m"] = _rms(difference)
        row[f"max_{role}_{axis}_m"] = _largest(difference)
        if role == "check":
            row[f"predicted_check_{axis}_m"] = _rms(table[f"sigma_d{axis}_m"].to_numpy(np.float64))
    return row


def _rms(values: Floats) -> float | None:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else None


def _largest(values: Floats) -> float | None:
    known = values[np.isfinite(values)]
    return float(np.abs(known).max()) if len(known) else None
