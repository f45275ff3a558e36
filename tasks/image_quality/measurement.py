"""Examine the images of a camera and write what was found; the stages are in `tasks.stages.image_quality`."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd

from adjust.image_quality.edge_search import GivenEdges
from adjust.image_quality.edge_statistics import ENOUGH
from tasks.errors import Location
from tasks.files.json_text import JSON
from tasks.image_files.image_reader import ImageDescription, described
from tasks.image_quality.edge_tables import edge_table, mean_tables, noise_table, smear_table
from tasks.image_quality.scenes import SceneQuality, examined_scene
from tasks.settings.image_quality import ImageQualitySettings
from tasks.store.notes import Notes, write_notes
from tasks.tables.parquet import of_schema, write_stage_table
from tasks.tables.schemas.image_quality import EDGE_MEANS, EDGE_RESPONSES, EDGES, NOISE_LEVELS, SMEARS

_log = logging.getLogger("aerocal")
_TENTHS = 10
# Figures of the edges of a band.
_OF_BAND = ["band", "edges", "factor", "sigma_factor", "mtf50", "mtf_nyquist", "sharpened"]


@dataclass
class Progress:
    """Progress of a part of a stage.

    Attributes
    ----------
    name : of the part, e.g. the file.
    start, share : fraction of the stage before it, and of itself, 0 to 1.
    """

    name: str
    start: float = 0.0
    share: float = 1.0
    _told: int = field(default=0, init=False)

    def tell(self, done: float) -> None:
        """Report that this fraction of the part is done, if it is a tenth more than reported last."""
        tenths = int(_TENTHS * done + 1e-9)
        if tenths > self._told:
            self._told = tenths
            fraction = self.start + self.share * done
            _log.info("%s: %.0f %%", self.name, 100.0 * done, extra={"stage_fraction": fraction})


def examine(folder: Path, settings: ImageQualitySettings) -> None:
    """Write edges, edge_means, edge_responses, noise_levels and smears.parquet, and the remarks.

    Raises
    ------
    InputError
        If an image cannot be read, or the images are not alike.
    """
    given = _given(settings)
    # Before the first is examined, which takes minutes where images are large.
    _require_alike([described(path) for path in settings.images])
    scenes = []
    for number, path in enumerate(settings.images):
        progress = Progress(path.name, number / len(settings.images), 1.0 / len(settings.images))
        scenes.append(examined_scene(path, given, progress.tell, chosen=settings.bands))
    means, responses = mean_tables(scenes, settings.gsd_m)
    smears = smear_table(scenes)
    tables = (
        (EDGES, edge_table(scenes)),
        (EDGE_MEANS, means),
        (EDGE_RESPONSES, responses),
        (NOISE_LEVELS, noise_table(scenes)),
        (SMEARS, smears),
    )
    for schema, table in tables:
        write_stage_table(folder, schema, of_schema(table, schema))
    write_notes(
        folder,
        Notes(
            (*_of_values(scenes), *_remarks(scenes, means), *_smears(smears)),
            {"image_quality": _figures(scenes, means)},
        ),
    )


def _given(settings: ImageQualitySettings) -> GivenEdges | None:
    """The edges that the settings name, if any."""
    if not (settings.points_px or settings.edges_px):
        return None
    points = np.array(settings.points_px, dtype=np.float64).reshape(-1, 2)
    return GivenEdges(points, np.array(settings.edges_px, dtype=np.float64).reshape(-1, 4))


def _require_alike(images: Sequence[ImageDescription]) -> None:
    first = images[0]
    for about in images[1:]:
        if (about.columns, about.rows, about.bands, about.dtype) != (
            first.columns,
            first.rows,
            first.bands,
            first.dtype,
        ):
            raise Location(about.path).error(
                f"The image has {about.columns} × {about.rows} pixels, {about.bands} bands of {about.dtype}; "
                f"{first.path.name} has {first.columns} × {first.rows}, {first.bands} of {first.dtype}.",
                "Examine the images of each camera separately.",
            )


def _of_values(scenes: Sequence[SceneQuality]) -> Iterator[str]:
    """Remarks on the grey values."""
    for scene in scenes:
        for band in scene.bands:
            yield from band.values.sentences(band.band)


def _remarks(scenes: Sequence[SceneQuality], means: pd.DataFrame) -> tuple[str, ...]:
    remarks = []
    whole = means[(means["direction"] == "all") & (means["zone"] == "all")]
    for band in sorted({band.band for scene in scenes for band in scene.bands}):
        own = whole[whole["band"] == band]
        edges = int(own["edges"].sum())
        if edges < ENOUGH:
            remarks.append(
                f"Band {band} has {edges} edges that can be measured, fewer than the {ENOUGH} that a "
                "mean should have. The most frequent reason is a lack of straight edges slanted by 2 to "
                "43 degrees."
            )
        if own["sharpened"].any():
            remarks.append(
                f"Band {band} has been sharpened: its edges overshoot by "
                f"{100 * own['overshoot'].iloc[0]:.1f} % of their contrast. "
                "Its factor does not describe the camera."
            )
    return tuple(remarks)


def _smears(smears: pd.DataFrame) -> Iterator[str]:
    """A sentence about every smear that chance does not explain."""
    for _, row in smears[smears["significant"]].iterrows():
        yield (
            f"{row['image']}, band {row['band']}: the blur of edges depends on their direction, as with "
            f"a smear of {row['length_px']:.2f} ± {row['sigma_length_px']:.2f} px along "
            f"{row['direction_deg']:.0f} ± {row['sigma_direction_deg']:.0f}° (from columns to rows)."
        )


def _figures(scenes: Sequence[SceneQuality], means: pd.DataFrame) -> JSON:
    first = scenes[0].description
    whole = means[(means["direction"] == "all") & (means["zone"] == "all")]
    refused: Counter[str] = Counter()
    for scene in scenes:
        for band in scene.bands:
            refused.update(band.edges.refused)
    return {
        "images": len(scenes),
        "columns": first.columns,
        "rows": first.rows,
        "dtype": first.dtype,
        "refused": dict(sorted(refused.items())),
        "bands": cast(JSON, whole[_OF_BAND].to_dict("records")),
    }
