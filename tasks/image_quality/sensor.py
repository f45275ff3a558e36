"""Examine a sensor by its protocol: defects, response to light, noise; a verdict for each sheet."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from adjust.image_quality.defects import Defects, defects
from adjust.image_quality.light_response import light_fall_off, linearity
from adjust.image_quality.photon_transfer import PhotonTransfer, photon_transfer
from tasks.errors import InputError, Location
from tasks.files.json_text import JSON, attributes
from tasks.image_files.image_reader import described
from tasks.image_quality.flat_images import FlatImages, flat_images, middle_levels, middle_means
from tasks.settings.image_quality import PROTOCOL, SensorSettings
from tasks.store.notes import Notes, write_notes
from tasks.tables.parquet import write_stage_table
from tasks.tables.schemas.image_quality import (
    APERTURE,
    DEFECT_COLUMNS,
    DEFECT_PIXELS,
    PHOTON_TRANSFER,
    SENSOR_SHEETS,
)

Row: TypeAlias = Mapping[str, str | float | int | bool | None]


@dataclass(eq=False)
class _Tables:
    """Rows of the tables so far."""

    sheets: list[Row] = field(default_factory=list)
    pixels: list[Row] = field(default_factory=list)
    columns: list[Row] = field(default_factory=list)
    transfer: list[Row] = field(default_factory=list)
    aperture: list[Row] = field(default_factory=list)
    transfers: list[JSON] = field(default_factory=list)

    def sheet(
        self,
        band: int,
        name: str,
        value: float,
        residual: float,
        threshold: float,
        *,
        sigma: float | None = None,
        degrees: int | None = None,
        unit: str = "",
        passed: bool | None = None,
    ) -> None:
        """Add a sheet; unless stated, it passes if the residual does not exceed the threshold."""
        self.sheets.append(
            {
                "band": band,
                "sheet": name,
                "value": value,
                "sigma": sigma,
                "unit": unit,
                "largest_residual": residual,
                "threshold": threshold,
                "passed": residual <= threshold if passed is None else passed,
                "degrees_of_freedom": degrees,
            }
        )


def examine_sensor(folder: Path, settings: SensorSettings) -> None:
    """Write sensor_sheets, defect_pixels, defect_columns, photon_transfer and aperture.parquet, and remarks.

    Raises
    ------
    InputError
        If an image cannot be read, images are not alike, or a series determines nothing.
    """
    tables = _Tables()
    bright = flat_images(settings.bright, settings.bright_limit, relative=True) if settings.bright else None
    dark = None
    if settings.dark:
        dark = flat_images(settings.dark, _dark_limit(settings, bright), relative=False)
    for band, tested in _by_band(bright, dark):
        _defects(tables, band, tested, settings)
    flat = bright or dark
    if bright is not None:
        _aperture(tables, bright, dark, settings)
    if settings.series:
        _series(tables, settings)
    written = (
        (SENSOR_SHEETS, tables.sheets),
        (DEFECT_PIXELS, tables.pixels),
        (DEFECT_COLUMNS, tables.columns),
        (PHOTON_TRANSFER, tables.transfer),
        (APERTURE, tables.aperture),
    )
    for schema, rows in written:
        names = [column.name for column in schema.columns]
        write_stage_table(folder, schema, pd.DataFrame(rows, columns=names))
    missed = [row for row in tables.sheets if not row["passed"]]
    failed = [f"{str(row['sheet']).replace('_', ' ')} of band {row['band']}" for row in missed]
    remarks = (f"The sensor does not meet its thresholds: {', '.join(failed)}.",) if failed else ()
    figures: dict[str, JSON] = {"passed": not failed, "missed": list(failed)}
    figures["photon_transfer"] = tables.transfers
    if flat is not None:
        figures |= {"columns": flat.description.columns, "rows": flat.description.rows}
    write_notes(folder, Notes(remarks, {"sensor": figures}))


def _dark_limit(settings: SensorSettings, bright: FlatImages | None) -> float | None:
    """As it is set; None: 1 % of the largest grey value of the files.

    Raises
    ------
    InputError
        If that is not the largest one of the sensor: bright images, at half its range, use less of it.
    """
    about = described(settings.dark[0])
    known = about.bits < 16 or bright is None or bool((bright.cells >= 0.25 * about.largest).any())
    if settings.dark_limit is None and (not known or about.dtype.startswith("float")):
        raise Location(about.path).error(
            f"The largest grey value of the sensor is not that of its files, {about.largest:.6g}.",
            "Set image_quality.sensor.dark_limit, grey values: 1 % of the largest value of the sensor.",
        )
    return settings.dark_limit


def _by_band(bright: FlatImages | None, dark: FlatImages | None) -> Iterator[tuple[int, dict[str, Ints]]]:
    """Deviating pixels of each band by the test in which they deviate."""
    tests = {name: images for name, images in (("bright", bright), ("dark", dark)) if images is not None}
    if len({images.description.bands for images in tests.values()}) > 1:
        raise InputError("Bright and dark images differ in their bands.", "Give images of one sensor.")
    bands = max((images.description.bands for images in tests.values()), default=0)
    for band in range(bands):
        yield band + 1, {name: images.deviating[band] for name, images in tests.items()}


def _defects(tables: _Tables, band: int, tested: Mapping[str, Ints], settings: SensorSettings) -> None:
    """Lists of a band, and the sheets of its numbers."""
    together = np.unique(np.concatenate(list(tested.values())), axis=0)
    found = defects(together, settings.column_pixels)
    of_test = {name: set(map(tuple, places.tolist())) for name, places in tested.items()}
    for number, ((row, column), cluster) in enumerate(
        zip(found.pixels.tolist(), found.cluster.tolist(), strict=True), start=1
    ):
        names = [name for name, places in of_test.items() if (row, column) in places]
        test = names[0] if len(names) == 1 else "both"
        tables.pixels.append(
            {"band": band, "number": number, "row": row, "column": column, "cluster": cluster, "test": test}
        )
    ends = ("row_start", "column_start", "row_end", "column_end")
    for number, places in enumerate(found.columns.tolist(), start=1):
        tables.columns.append({"band": band, "number": number, **dict(zip(ends, places, strict=True))})
    _defect_sheets(tables, band, found, settings)


def _defect_sheets(tables: _Tables, band: int, found: Defects, settings: SensorSettings) -> None:
    pixels, single, double = PROTOCOL[settings.kind]
    for name, value, threshold in (
        ("defect_pixels", len(found.pixels), pixels),
        ("defect_columns_single", found.single, single),
        ("defect_columns_double", found.double, double),
    ):
        tables.sheet(band, name, value, value, threshold)
    distance = found.smallest_distance
    if distance is not None:
        keeps = distance >= settings.column_distance
        tables.sheet(
            band,
            "defect_column_distance",
            distance,
            distance,
            settings.column_distance,
            unit="columns",
            passed=keeps,
        )


def _aperture(tables: _Tables, bright: FlatImages, dark: FlatImages | None, settings: SensorSettings) -> None:
    level = np.zeros(bright.description.bands) if dark is None else dark.mean
    about = bright.description
    for band in range(about.bands):
        found = light_fall_off(
            bright.cells[band] - level[band], bright.counts[band], about.columns, about.rows
        )
        corner = float(found.light[-1])
        tables.sheet(
            band + 1, "aperture", corner, found.largest, settings.aperture_limit, unit="light at the corners"
        )
        for (row, column), light in np.ndenumerate(found.cells):
            tables.aperture.append({"band": band + 1, "row": row, "column": column, "light": float(light)})


def _series(tables: _Tables, settings: SensorSettings) -> None:
    """Linearity, sensitivity and photon transfer of every band."""
    levels = sorted(settings.series, key=lambda level: level.exposure_ms)
    exposure = np.array([level.exposure_ms for level in levels])
    measured = [list(middle_levels(level.images)) for level in levels]
    dark = middle_means(settings.dark)
    for band in range(len(measured[0])):
        mean, variance, pixels, whole = np.array([level[band] for level in measured]).T
        try:
            transfer = photon_transfer(mean, variance, pixels, float(dark[band]), quantised=bool(whole.all()))
            used = transfer.used[np.argsort(np.argsort(mean))]
            line = linearity(exposure[used], mean[used])
        except ValueError as error:
            raise InputError(
                f"The exposure series of band {band + 1} cannot be evaluated: {error}.",
                "Give pairs of images at five or more exposures between dark and full well.",
            ) from error
        _transfer_sheets(tables, band + 1, transfer, settings)
        tables.sheet(
            band + 1,
            "linearity",
            line.dark,
            line.largest,
            settings.linearity_limit,
            unit="grey value without light",
        )
        relative = line.sigma_sensitivity / line.sensitivity
        tables.sheet(
            band + 1, "sensitivity", line.sensitivity, relative, settings.sensitivity_limit,
            sigma=line.sigma_sensitivity, degrees=len(line.mean) - 2, unit="grey values/ms",
        )  # fmt: skip
        residual = (mean - line.dark - line.sensitivity * exposure) / (
            line.sensitivity * exposure[used].max()
        )
        _transfer_rows(tables, band + 1, exposure, mean, transfer, residual)


def _transfer_sheets(tables: _Tables, band: int, transfer: PhotonTransfer, settings: SensorSettings) -> None:
    tables.sheet(
        band, "noise", transfer.read_noise, transfer.residual, settings.transfer_limit,
        sigma=transfer.sigma_read_noise, unit="electrons of read noise",
    )  # fmt: skip
    names = ("gain", "sigma_gain", "read_noise", "sigma_read_noise", "full_well", "statistic")
    tables.transfers.append({"band": band, **attributes(transfer, *names)})


def _transfer_rows(
    tables: _Tables, band: int, exposure: Floats, mean: Floats, transfer: PhotonTransfer, residual: Floats
) -> None:
    order = np.argsort(mean)
    for rank, level in enumerate(order.tolist()):
        tables.transfer.append(
            {
                "band": band,
                "exposure_ms": float(exposure[level]),
                "signal": float(transfer.signal[rank]),
                "variance": float(transfer.variance[rank]),
                "used": bool(transfer.used[rank]),
                "residual": float(residual[level]),
            }
        )
