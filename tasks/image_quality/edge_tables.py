"""Edges, their means and responses as columns of tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TypeAlias

import numpy as np
import pandas as pd

from adjust.image_quality.edge_measurement import MeasuredEdge
from adjust.image_quality.edge_profile import EdgeProfile, edge_profile, normalized
from adjust.image_quality.edge_statistics import EdgeStatistics, edge_statistics
from adjust.image_quality.iso_12233 import FrequencyResponse, frequency_response
from adjust.image_quality.smear import Smear, smear
from tasks.files.json_text import JSON, attributes
from tasks.image_quality.scenes import SceneQuality
from tasks.tables.schemas.image_quality import (
    DIRECTIONS,
    EDGE_MEANS,
    EDGE_RESPONSES,
    EDGES,
    NOISE_LEVELS,
    SMEARS,
    ZONES,
)

Row: TypeAlias = Mapping[str, JSON]


def edge_table(scenes: Sequence[SceneQuality]) -> pd.DataFrame:
    """A row for each edge."""
    rows = [
        _edge(scene, band.band, number, edge)
        for scene in scenes
        for band in scene.bands
        for number, edge in enumerate(band.edges.edges, start=1)
    ]
    return pd.DataFrame(rows, columns=[column.name for column in EDGES.columns])


def _edge(scene: SceneQuality, band: int, number: int, edge: MeasuredEdge) -> Row:
    pixels = normalized([edge.fit])
    line, fit = edge.line, edge.fit
    return {
        "image": scene.image,
        "band": band,
        "edge": number,
        "column_px": line.column,
        "row_px": line.row,
        "normal_deg": float(np.rad2deg(line.angle)),
        "direction": _direction(edge),
        "radius": _radius(scene, edge),
        "length_px": line.length,
        "contrast": fit.contrast,
        "noise": edge.noise,
        "blur_px": fit.blur,
        "sigma_blur_px": fit.sigma_blur,
        "factor": fit.factor,
        "sigma_factor": fit.sigma_factor,
        **_response(edge_profile(pixels), frequency_response(pixels)),
    }


def _response(profile: EdgeProfile, response: FrequencyResponse) -> Row:
    return {
        "mtf50": response.mtf50,
        "mtf_nyquist": response.at_nyquist,
        "overshoot": profile.overshoot,
        "sigma_overshoot": profile.sigma_overshoot,
        "sharpened": profile.sharpened,
    }


def _direction(edge: MeasuredEdge) -> str:
    return DIRECTIONS[0] if edge.line.crosses_columns else DIRECTIONS[1]


def _radius(scene: SceneQuality, edge: MeasuredEdge) -> float:
    about = scene.description
    middle = 0.5 * (about.columns - 1), 0.5 * (about.rows - 1)
    return float(np.hypot(edge.line.column - middle[0], edge.line.row - middle[1]) / np.hypot(*middle))


def _zone(scene: SceneQuality, edge: MeasuredEdge) -> str:
    return ZONES[min(int(len(ZONES) * _radius(scene, edge)), len(ZONES) - 1)]


def mean_tables(scenes: Sequence[SceneQuality], gsd_m: float | None) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Means by band, direction and zone, and the responses by band and direction."""
    means: list[Row] = []
    responses: list[pd.DataFrame] = []
    for band in sorted({band.band for scene in scenes for band in scene.bands}):
        for direction, zone, edges in _groups(scenes, band):
            found = edge_statistics(edges)
            means.append({"band": band, "direction": direction, "zone": zone, **_mean(found, gsd_m)})
            if direction in DIRECTIONS and zone == "all":
                curve = {"frequency": found.response.frequency, "response": found.response.response}
                responses.append(pd.DataFrame({"band": band, "direction": direction, **curve}))
    names = [[column.name for column in schema.columns] for schema in (EDGE_MEANS, EDGE_RESPONSES)]
    joined = pd.concat(responses) if responses else pd.DataFrame(columns=names[1])
    return pd.DataFrame(means, columns=names[0]), joined


def _groups(scenes: Sequence[SceneQuality], band: int) -> Iterator[tuple[str, str, list[MeasuredEdge]]]:
    """The edges of a band in every direction and zone that has any."""
    placed = [
        (_direction(edge), _zone(scene, edge), edge)
        for scene in scenes
        for one in scene.bands
        if one.band == band
        for edge in one.edges.edges
    ]
    for direction in ("all", *DIRECTIONS):
        for zone in ("all", *ZONES):
            edges = [edge for d, z, edge in placed if direction in ("all", d) and zone in ("all", z)]
            if edges:
                yield direction, zone, edges


def _mean(found: EdgeStatistics, gsd_m: float | None) -> Row:
    return {
        **attributes(found, "edges", "left_out", "factor", "sigma_factor", "method", "scatter", "stated"),
        "blur_px": found.blur,
        "effective_gsd_m": None if gsd_m is None else found.factor * gsd_m,
        "sigma_effective_gsd_m": None if gsd_m is None else found.sigma_factor * gsd_m,
        **_response(found.profile, found.response),
    }


def smear_table(scenes: Sequence[SceneQuality]) -> pd.DataFrame:
    """A row for each band of each image whose edges determine a smear."""
    rows: list[Row] = []
    for scene in scenes:
        for band in scene.bands:
            fits = [edge.fit for edge in band.edges.edges]
            found = smear(np.array([fit.angle for fit in fits]), np.array([fit.blur for fit in fits]))
            if found is not None:
                rows.append({"image": scene.image, "band": band.band, **_smear(found)})
    return pd.DataFrame(rows, columns=[column.name for column in SMEARS.columns])


def _smear(found: Smear) -> Row:
    return {
        "edges": found.edges,
        "length_px": found.length,
        "sigma_length_px": found.sigma_length,
        "direction_deg": float(np.rad2deg(found.direction)),
        "sigma_direction_deg": float(np.rad2deg(found.sigma_direction)),
        "probability": found.probability,
        "significant": found.significant,
    }


def noise_table(scenes: Sequence[SceneQuality]) -> pd.DataFrame:
    """A row for each grey level of each band of each image."""
    parts = [
        pd.DataFrame(
            {
                "image": scene.image,
                "band": band.band,
                "level": band.levels.level,
                "noise": band.levels.noise,
                "sigma_noise": band.levels.sigma_noise,
                "signal_to_noise": band.levels.level
                / np.where(band.levels.noise > 0, band.levels.noise, np.nan),
                "tiles": band.levels.tiles,
            }
        )
        for scene in scenes
        for band in scene.bands
    ]
    columns = [column.name for column in NOISE_LEVELS.columns]
    return pd.concat(parts)[columns] if parts else pd.DataFrame(columns=columns)
