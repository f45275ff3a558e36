"""Homologous points of pairs of images (``Pastis<image>/<image>.txt`` of MicMac), joined to tie points.

A line is ``x1 y1 x2 y2`` and, perhaps, a weight. The same place in an image is the same point in all pairs; chains of pairs are one
tie point. A tie point with two places in one image contradicts itself and is left out.
"""  # noqa: E501

from __future__ import annotations

import io
from array import array
from pathlib import PurePosixPath
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from adjust.arrays import Floats
from tasks.errors import InputError, Location
from tasks.formats.long_columns import table_of
from tasks.formats.packed_folder import PackedFolder
from tasks.formats.plain_records import image_points_of, numbers_of
from tasks.formats.records import ImagePointRecords

_HEAD, _TAIL = "Pastis", ".txt"


def homologous_points(folder: PackedFolder) -> ImagePointRecords:
    """The tie points of all pairs.

    Raises
    ------
    InputError
        If there is no pair, or a line is not complete.
    """
    names: dict[str, int] = {}
    pairs, counts, places = [], [], [np.zeros((0, 4))]
    for member in folder.members:
        parts = PurePosixPath(member).parts
        if len(parts) < 2 or not parts[-2].startswith(_HEAD) or not parts[-1].endswith(_TAIL):
            continue
        pairs.append(
            [
                names.setdefault(name, len(names))
                for name in (parts[-2][len(_HEAD) :], parts[-1][: -len(_TAIL)])
            ]
        )
        places.append(_rows(folder, member))
        counts.append(len(places[-1]))
    if not names:
        raise Location(folder.file).error(
            "There are no homologous points Pastis…/….txt in the packed folder.",
            "Write them as text in MicMac (ExpTxt=1), and pack the folder Homol.",
        )
    of_ends = np.concatenate([np.repeat(of, counts) for of in np.array(pairs, dtype=np.int32).T])
    ends = np.concatenate([*(rows[:, :2] for rows in places), *(rows[:, 2:] for rows in places)])
    # As large as the ends themselves, and the file next to them.
    places.clear()
    folder.archive.close()
    kept, track = joined_to_tracks(of_ends, ends)
    return image_points_of(
        folder.file,
        named(of_ends[kept], pa.array(names, pa.string())),
        tie_names(track),
        ends[kept],
        range(1, len(kept) + 1),
    )


def _rows(folder: PackedFolder, member: str) -> Floats:
    found = array("d")
    # Line by line: a list of them takes several times the text.
    lines = io.TextIOWrapper(io.BytesIO(folder.read(member)), encoding="latin-1", newline=None)
    for number, line in enumerate(lines, start=1):
        if line.strip():
            try:
                found.extend(numbers_of(folder.file, line.split(), 4, number, "x1 y1 x2 y2"))
            except InputError as error:
                raise Location(folder.file, number, member).error(error.what, error.remedy) from error
    return table_of(found, 4)


def named(number: NDArray[np.integer[Any]], names: pa.Array) -> pa.DictionaryArray:
    """Names (n,) by their numbers, each kept once: without a text for every row."""
    encoded = pa.array(number).dictionary_encode()
    return pa.DictionaryArray.from_arrays(encoded.indices, names.take(encoded.dictionary))


def tie_names(track: NDArray[np.int64]) -> pa.DictionaryArray:
    """Names of tie points (n,) by their numbers, all of them from 1 on."""
    import pyarrow.compute as pc

    numbers = pa.array(np.arange(1, track.max(initial=0) + 1)).cast(pa.string())
    return pa.DictionaryArray.from_arrays(
        (track - 1).astype(np.int32), pc.binary_join_element_wise("tie", numbers, "")
    )


def joined_to_tracks(
    image: NDArray[np.integer[Any]], xy: NDArray[np.floating[Any]]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Of 2 k ends of k pairs, those that are kept, each place once, and their tie points, from 1.

    The first ends of all pairs come first, then the second ones.
    """
    # Loaded for these files only, as a run that finds everything stored reads none.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    order = np.lexsort((xy[:, 1], xy[:, 0], image))
    differs = np.zeros(len(order), dtype=bool)
    differs[:1] = True
    for column in (image, xy[:, 0], xy[:, 1]):
        ascending = column[order]
        differs[1:] |= ascending[1:] != ascending[:-1]
    # A file has fewer lines than these numbers count.
    first, half = order[differs].astype(np.int32), len(image) // 2
    count = len(first)
    place = np.empty(len(order), dtype=np.int32)
    place[order] = np.cumsum(differs, dtype=np.int32) - 1
    del order, differs
    edges = coo_array((np.ones(half, dtype=np.int8), (place[:half], place[half:])), shape=(count, count))
    track = connected_components(edges, directed=False)[1]
    del edges, place
    # Two places of one track in one image.
    images = int(image.max(initial=0)) + 1
    in_image = track * np.int64(images) + image[first]
    in_image.sort()
    doubled = np.zeros(track.max(initial=-1) + 1, dtype=bool)
    doubled[in_image[1:][in_image[1:] == in_image[:-1]] // images] = True
    del in_image
    good = ~doubled[track]
    kept, found = first[good], track[good]
    del first, track, good
    order = np.argsort(kept, kind="stable")
    _, numbers = np.unique(found[order], return_inverse=True)
    return kept[order].astype(np.int64), numbers.reshape(-1) + 1
