"""Images and points that are not used or not connected to the others, according to the tables."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from tasks.deliveries.image_points import without_image_points
from tasks.formats.meanings import IMAGE_POINT_MEANINGS
from tasks.nearest_name import look_alike, plain
from tasks.plain_text import some_of
from tasks.plausibility.mistake import Mistake

_MOST_NAMES = 8
_MOST_PAIRS = 3


def uncovered(exposures: pd.DataFrame, measured: pd.DataFrame, control: pd.DataFrame) -> Iterator[Mistake]:
    """Images without image points or points in common with others, control that is not measured."""
    images = pd.Index(measured["image"].unique())
    without = exposures["image"][~exposures["image"].isin(images)]
    if len(without):
        yield Mistake(
            without_image_points(len(without), len(exposures)),
            (some_of(without, _MOST_NAMES),),
            "Deliver their image points, or leave the exposures out.",
        )
    groups = _groups(measured, images)
    sizes = groups.value_counts()
    alone = groups.index[groups != sizes.index[0]]
    if len(alone):
        yield Mistake(
            f"{len(alone):,} images have no points in common with the other {int(sizes.iloc[0]):,}: "
            f"{some_of(alone, _MOST_NAMES)}.",
            (f"the block consists of {len(sizes)} parts, {_without_control(groups, measured, control)}",),
            "Measure tie points between them and the others, or leave them out.",
        )
    surveyed = control["point"]
    lost = surveyed[~surveyed.isin(measured["point"])]
    if len(lost):
        yield Mistake(
            f"{len(lost):,} of {len(surveyed):,} control and check points are not measured in any image: "
            f"{some_of(lost, _MOST_NAMES)}.{spelled_otherwise(list(lost), list(measured['point'].unique()))}",
            (),
            "Measure them, or check that both files use the same names.",
        )


def spelled_otherwise(missing: Sequence[str], known: Collection[str]) -> str:
    """A sentence about missing names that others resemble but for what `_spelling` leaves out, or none."""
    by_key = {_spelling(name): name for name in reversed(list(known))}
    found = [(name, by_key[_spelling(name)]) for name in missing if _spelling(name) in by_key]
    if not found:
        return ""
    pairs = ", ".join(f"'{name}' may be '{other}'" for name, other in found[:_MOST_PAIRS])
    others = f" Names of {len(found):,} of them are spelled otherwise in the image points: {pairs}."
    return others + look_alike(*found[0])


def _spelling(name: str) -> str:
    """A name without case, zeros before a number and signs between a word and its number.

    Nor with the encoding of its accents, and the decimals of a spreadsheet after a whole number.
    """
    whole = re.sub(r"(?<=\d)\.0$", "", plain(name).strip().casefold())
    return re.sub(r"(?<!\d)0+(?=\d)", "", re.sub(r"(?<=[^\W\d_])[\s_.-]+(?=\d)", "", whole))


def _without_control(groups: pd.Series, measured: pd.DataFrame, control: pd.DataFrame) -> str:
    """How many parts of the block see no surveyed point, in words."""
    surveyed = measured["image"][measured["point"].isin(control["point"])].unique()
    count = groups.nunique() - groups.loc[surveyed].nunique()
    return f"{count} of them without control"


def _groups(measured: pd.DataFrame, images: pd.Index) -> pd.Series:
    """Number of the connected part of the block that each image is in."""
    # Loaded late: the command line starts without it.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    image = images.get_indexer(pd.Index(measured["image"]))
    point, points = pd.factorize(measured["point"])
    size = len(images) + len(points)
    links = coo_array((np.ones(len(image)), (image, len(images) + point)), shape=(size, size))
    return pd.Series(connected_components(links, directed=False)[1][: len(images)], index=images)


def other_pixel_origins(formats: Mapping[str, str], origins: Mapping[str, str]) -> Iterator[Mistake]:
    """Cameras whose declared pixel origin differs from that of the files.

    Parameters
    ----------
    formats : file names of image points in pixels → their format.
    origins : names of cameras → `pixel_origin` as declared.
    """
    for file, name in formats.items():
        meaning = IMAGE_POINT_MEANINGS.get(name)
        if meaning is None or meaning.origin is None:
            continue
        for camera, declared in origins.items():
            if declared != meaning.origin:
                yield Mistake(
                    f"{file} counts pixels from the {meaning.origin} of the first one, but pixel_origin of "
                    f"{camera} is {declared}: all image points are half a pixel off in both directions.",
                    (f"format {name}: {meaning.origin}", f"project file: {declared}"),
                    f'Declare pixel_origin = "{meaning.origin}" for the camera.',
                    f'cameras.{camera}.pixel_origin = "{meaning.origin}"',
                )
