"""Parts of the observations that get standard deviations of their own: by file, camera and flight."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from adjust.arrays import Ints
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.ins_attitude import InsAttitudes
from adjust.quality.observation_parts import Division
from adjust.solve.system import Observations
from tasks.block.given_orientations import GivenOrientations
from tasks.settings.adjustment import AdjustmentSettings


def divisions_of(
    observations: Observations,
    given: GivenOrientations,
    input_file: pd.Series,
    rows: Ints,
    settings: AdjustmentSettings,
) -> tuple[Division, ...]:
    """The divisions that the settings ask for, of groups that have more than one part.

    Parameters
    ----------
    input_file : names of the files of all image points that were delivered.
    rows : (n,) which of these the image points of the observations are.
    """
    if not settings.variance_components:
        return ()
    by = settings.variance_components_by
    rays = observations.image_points
    names = np.array(given.mountings.names, dtype=object)[rays.camera_of_image[rays.image]]
    labels = [
        *((input_file.to_numpy(dtype=object)[rows],) if "file" in by else ()),
        *((np.array([f"camera {name}" for name in names], dtype=object),) if "camera" in by else ()),
    ]
    return tuple(
        division
        for division in (
            *(_division(rays.name, together) for together in _joined(labels)),
            *(
                _division(group.name, np.array(given.flight, dtype=object)[group.event], "flight ")
                for group in observations.others
                if "flight" in by and isinstance(group, GnssPositions | InsAttitudes)
            ),
        )
        if len(division.names) > 1
    )


def _joined(labels: list[np.ndarray]) -> Iterator[np.ndarray]:
    """The labels (n,) of several kinds combined; None without any."""
    if labels:
        first, *others = labels
        for other in others:
            first = first + ", " + other
        yield first


def _division(group: str, label: np.ndarray, before: str = "") -> Division:
    index, names = pd.factorize(label, sort=True)
    return Division(group, tuple(f"{before}{name}" for name in names), index.astype(np.int64))
