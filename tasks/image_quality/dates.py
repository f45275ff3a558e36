"""Compare an examination with that of an earlier date, and write what has changed.

Change of the effective resolution: every mean against the same one then. Change of noise, sensitivity,
read noise and defects, each with its σ and a test: noise of scenes is compared at the same grey levels,
the earlier one interpolated between its levels. Of defects those are counted that are new and those that
are gone. Where nothing has changed, a pixel near its limit appears as often as it goes, so that (new −
gone)/√(new + gone) is a standard normal variable (McNemar 1947); pixels that are defects at both dates say
nothing about a change.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.image_quality.change import critical_change
from tasks.document_kit.table import Number, decimals_for
from tasks.errors import Location
from tasks.files.json_text import JSON
from tasks.image_quality.radiometric_record import LIMIT
from tasks.store.notes import Notes, write_notes
from tasks.tables.foreign import read_foreign_table
from tasks.tables.parquet import of_schema, write_stage_table
from tasks.tables.schemas.columns import TableSchema
from tasks.tables.schemas.image_quality import (
    DEFECT_COLUMNS,
    DEFECT_PIXELS,
    EDGE_DRIFT,
    EDGE_MEANS,
    NOISE_LEVELS,
    QUALITY_DRIFT,
    SENSOR_SHEETS,
)

_REMEDY = "Name the folder of results of `aerocal image-quality`."
_KEY = ["band", "direction", "zone"]


def drift_table(means: pd.DataFrame, earlier: Path) -> pd.DataFrame:
    """A row for every mean that there is at both dates.

    Raises
    ------
    InputError
        If the file is not a table of means, or has none of them.
    """
    then, _ = read_foreign_table(earlier, EDGE_MEANS, _REMEDY)
    kept = [*_KEY, "factor", "sigma_factor", "edges", "method"]
    both = means.merge(then[kept], on=_KEY, suffixes=("", "_then"))
    if both.empty:
        raise Location(earlier).error(
            "The earlier results have none of the bands.", "Name results of the same camera."
        )
    values = both[["factor", "factor_then", "sigma_factor", "sigma_factor_then"]].to_numpy(np.float64)
    change: Floats = values[:, 0] - values[:, 1]
    sigma: Floats = np.hypot(values[:, 2], values[:, 3])
    t: Floats = change / np.where(sigma > 0.0, sigma, np.nan)
    degrees = np.column_stack([_degrees_of_mean(both, suffix) for suffix in ("", "_then")])
    drift = both[_KEY].assign(
        earlier=both["factor_then"],
        factor=both["factor"],
        change=change,
        sigma_change=sigma,
        t=t,
        drifted=np.abs(t) > critical_change(values[:, 2:], degrees),
    )
    return drift[[column.name for column in EDGE_DRIFT.columns]]


def _degrees_of_mean(means: pd.DataFrame, suffix: str) -> Floats:
    """Degrees of freedom of σ of the factors: of the scatter of edges; the profile has all pixels."""
    scatter = means[f"edges{suffix}"].to_numpy(np.float64) - 1.0
    return np.where(means[f"method{suffix}"] == "model", scatter, np.inf)


def drift_remarks(drift: pd.DataFrame) -> tuple[str, ...]:
    """A sentence about all edges of every band that has drifted."""
    whole = drift[(drift["direction"] == "all") & (drift["zone"] == "all") & drift["drifted"]]
    return tuple(
        f"The factor of band {row['band']} has changed by {Number(row['change'], 3, plus=True)} ± "
        f"{row['sigma_change']:.3f} "
        f"since the earlier date, from {row['earlier']:.3f} to {row['factor']:.3f}."
        for _, row in whole.iterrows()
    )


#: Sheets whose value has a standard deviation, and what the value is.
_OF_SHEETS = {"sensitivity": "sensitivity", "noise": "read_noise"}
_PLACES = {"defect_pixels": ["row", "column"], "defect_columns": ["column_start", "column_end"]}
_SCHEMAS: tuple[TableSchema, ...] = (NOISE_LEVELS, SENSOR_SHEETS, DEFECT_PIXELS, DEFECT_COLUMNS)
_Row = Mapping[str, object]


def quality_drift_table(now: Mapping[str, pd.DataFrame], earlier: Path) -> pd.DataFrame:
    """A row for each quantity of each band that there is at both dates.

    Parameters
    ----------
    now : contents of the tables of this examination, by name.
    earlier : folder of the earlier results.

    Raises
    ------
    InputError
        If a table there is none.
    """
    rows: list[_Row] = []
    then = {
        schema.name: read_foreign_table(earlier / f"{schema.name}.parquet", schema, _REMEDY)[0]
        for schema in _SCHEMAS
        if schema.name in now and (earlier / f"{schema.name}.parquet").is_file()
    }
    if "noise_levels" in then:
        rows += noise_changes(now["noise_levels"], then["noise_levels"])
    if "sensor_sheets" in then:
        rows += _sheets(now["sensor_sheets"], then["sensor_sheets"])
        for name, places in _PLACES.items():
            examined = then["sensor_sheets"], now["sensor_sheets"]
            if all(sheets["sheet"].eq("defect_pixels").any() for sheets in examined) and name in then:
                bands = np.unique(now["sensor_sheets"]["band"])
                rows += _defects(name, now[name], then[name], places, bands.tolist())
    return pd.DataFrame(rows, columns=[column.name for column in QUALITY_DRIFT.columns])


def _row(band: int, quantity: str, then: float, now: float, sigma: float, critical: float = LIMIT) -> _Row:
    t = (now - then) / sigma if sigma > 0.0 else float("nan")
    return {
        "band": band,
        "quantity": quantity,
        "earlier": then,
        "value": now,
        "change": now - then,
        "sigma_change": sigma,
        "t": t,
        "drifted": bool(abs(t) > critical),
    }


def noise_changes(now: pd.DataFrame, then: pd.DataFrame) -> Iterator[_Row]:
    """Weighted mean noise at those present levels that lie between the earlier ones."""
    for band, own in now.groupby("band"):
        before = then[then["band"] == band].sort_values("level")
        if before.empty:
            continue
        level, noise, sigma = own[["level", "noise", "sigma_noise"]].to_numpy(np.float64).T
        known, noise_then, sigma_then = before[["level", "noise", "sigma_noise"]].to_numpy(np.float64).T
        both = (level >= known[0]) & (level <= known[-1])
        if not both.any():
            continue
        # (levels now, levels then): several of now may lie between the same two then, and share their errors.
        between = np.stack([np.interp(level[both], known, unit) for unit in np.eye(len(known))], axis=1)
        weight = 1.0 / np.maximum(sigma[both] ** 2 + between**2 @ sigma_then**2, 1e-18)
        weight /= weight.sum()
        mean_then, mean_now = float(weight @ between @ noise_then), float(weight @ noise[both])
        variance = weight**2 @ sigma[both] ** 2 + (weight @ between) ** 2 @ sigma_then**2
        yield _row(int(str(band)), "noise", mean_then, mean_now, float(np.sqrt(max(variance, 1e-18))))


def _sheets(now: pd.DataFrame, then: pd.DataFrame) -> Iterator[_Row]:
    """Values with standard deviations."""
    both = now.merge(then, on=["band", "sheet"], suffixes=("", "_then"))
    for _, row in both[both["sheet"].isin(list(_OF_SHEETS))].iterrows():
        both_dates = row[["sigma", "sigma_then"]].to_numpy(np.float64)
        degrees = row[["degrees_of_freedom", "degrees_of_freedom_then"]].to_numpy(np.float64)
        critical = critical_change(both_dates[None], np.nan_to_num(degrees, nan=np.inf)[None])[0]
        sigma = float(np.hypot(*both_dates))
        yield _row(row["band"], _OF_SHEETS[row["sheet"]], row["value_then"], row["value"], sigma, critical)


def _defects(
    name: str, now: pd.DataFrame, then: pd.DataFrame, places: list[str], bands: list[int]
) -> Iterator[_Row]:
    """Defects that are new and those that are gone."""
    for band in bands:
        here, there = (
            set(table.loc[table["band"] == band, places].itertuples(index=False, name=None))
            for table in (now, then)
        )
        changed = len(here - there) + len(there - here)
        yield _row(band, name, float(len(there)), float(len(here)), float(np.sqrt(changed)))


_WORDS = {
    "noise": "noise of scenes at the same grey values",
    "sensitivity": "sensitivity",
    "read_noise": "read noise",
    "defect_pixels": "number of defect pixels",
    "defect_columns": "number of defect columns",
}


def quality_drift_remarks(drift: pd.DataFrame) -> tuple[str, ...]:
    """A sentence about every quantity that has drifted."""
    return tuple(_remark(row) for _, row in drift[drift["drifted"]].iterrows())


def _remark(row: pd.Series) -> str:
    counted = str(row["quantity"]).startswith("defect")
    decimals = 0 if counted else decimals_for(row["sigma_change"])
    then, now, sigma = (Number(row[name], decimals) for name in ("earlier", "value", "sigma_change"))
    change = Number(row["change"], decimals, plus=True)
    return (
        f"The {_WORDS[row['quantity']]} of band {row['band']} has changed by {change}"
        f"{'' if counted else f' ± {sigma}'} since the earlier date, from {then} to {now}."
    )


def write_drift(folder: Path, tables: Mapping[str, pd.DataFrame], earlier: Path) -> None:
    """Write edge_drift.parquet, quality_drift.parquet and the remarks.

    Parameters
    ----------
    tables : of the examination of now, by name.
    earlier : folder of the earlier results.

    Raises
    ------
    InputError
        If a table there is none, or there is nothing to compare.
    """
    means = earlier / "edge_means.parquet"
    edges = pd.DataFrame(columns=[column.name for column in EDGE_DRIFT.columns])
    if "edge_means" in tables and means.is_file():
        edges = drift_table(tables["edge_means"], means)
    others = quality_drift_table(tables, earlier)
    if edges.empty and others.empty:
        raise Location(earlier).error(
            "The earlier results and these have nothing in common.",
            "Name the folder of an examination of the same camera, likewise of scenes or of its sensor.",
        )
    for schema, table in ((EDGE_DRIFT, edges), (QUALITY_DRIFT, others)):
        write_stage_table(folder, schema, of_schema(table, schema))
    remarks = (*drift_remarks(edges), *quality_drift_remarks(others))
    figures: dict[str, JSON] = {
        "drift": {
            "drifted": len(remarks),
            "edge_means": len(edges),
            "drifted_edge_means": int(edges["drifted"].sum()),
            "quantities": len(others),
            "drifted_quantities": int(others["drifted"].sum()),
        }
    }
    write_notes(folder, Notes(remarks, figures))
