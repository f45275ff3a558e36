"""What the page about image quality is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

import pandas as pd

from tasks.files.json_text import JSON
from tasks.settings.image_quality import ImageQualitySettings
from tasks.store.artifact import Artifact
from tasks.store.notes import read_notes
from tasks.tables.parquet import read_table


@dataclass(frozen=True, eq=False)
class QualityMaterial:
    """Tables and figures of an examination.

    Attributes
    ----------
    edges, means, responses, noise : tables of these contents.
    figures : of the notes.
    problems : remarks.
    settings : of the run.
    """

    edges: pd.DataFrame
    means: pd.DataFrame
    responses: pd.DataFrame
    noise: pd.DataFrame
    figures: Mapping[str, JSON]
    problems: tuple[str, ...]
    settings: ImageQualitySettings

    @property
    def bands(self) -> tuple[int, ...]:
        """Numbers of the bands that were examined."""
        return tuple(sorted({int(band) for table in (self.means, self.noise) for band in table["band"]}))

    @property
    def whole(self) -> pd.DataFrame:
        """The means of all edges of each band."""
        return self.means[(self.means["direction"] == "all") & (self.means["zone"] == "all")]

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the images."""
        return int(cast(int, self.figures["columns"])), int(cast(int, self.figures["rows"]))


def read_quality(examined: Mapping[str, Artifact], settings: ImageQualitySettings) -> QualityMaterial:
    """Read what the examination wrote."""
    notes = read_notes(examined["notes"])
    figures = cast(Mapping[str, JSON], notes.figures["image_quality"])
    return QualityMaterial(
        edges=read_table(examined["edges"]),
        means=read_table(examined["edge_means"]),
        responses=read_table(examined["edge_responses"]),
        noise=read_table(examined["noise_levels"]),
        figures=figures,
        problems=notes.problems,
        settings=settings,
    )
