"""Homologous points of pairs of images (``Pastis<image>/<image>.txt`` of MicMac), joined to tie points.

A line is ``x1 y1 x2 y2`` and, perhaps, a weight. The same place in an image is the same point in all pairs; chains of pairs are one
tie point. A tie point with two places in one image contradicts itself and is left out.
"""  # noqa: E501

from __future__ import annotations

from array import array
from pathlib import PurePosixPath
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from adjust.arrays import Floats
from tasks.errors import InputError
from tasks.formats.long_columns import table_of
from tasks.formats.packed_folder import PackedFolder
from tasks.formats.plain_records import image_points_of, names_of_numbers, numbers_of
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
    image, places = [np.zeros((0, 2), dtype=np.int64)], [np.zeros((0, 4))]
    for member in folder.members:
        parts = PurePosixPath(member).parts
        if len(parts) < 2 or not parts[-2].startswith(_HEAD) or not parts[-1].endswith(_TAIL):
            continue
        pair = [
            names.setdefault(name, len(names)) for name in (parts[-2][len(_HEAD) :], parts[-1][: -len(_TAIL)])
        ]
        rows = _rows(folder, member)
        image.append(np.tile(np.array(pair, dtype=np.int64), (len(rows), 1)))
        places.append(rows)
    if not names:
        raise InputError(
            "There are no homologous points Pastis…/….txt in the packed folder.",
            "Write them as text in MicMac (ExpTxt=1), and pack the folder Homol.",
            file=folder.file,
        )
    of_ends = np.concatenate(image).T.reshape(-1)
    xy = np.concatenate(places)
    ends = np.concatenate([xy[:, :2], xy[:, 2:]])
    kept, track = joined_to_tracks(of_ends, ends)
    return image_points_of(
        folder.file,
        pa.array(names, pa.string()).take(pa.array(of_ends[kept])).dictionary_encode(),
        tie_names(track),
        ends[kept],
        range(1, len(kept) + 1),
    )


def _rows(folder: PackedFolder, member: str) -> Floats:
    found = array("d")
    text = folder.read(member).decode("latin-1")
    for number, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1):
        if line.strip():
            try:
                found.extend(numbers_of(folder.file, line.split(), 4, number, "x1 y1 x2 y2"))
            except InputError as error:
                raise InputError(error.what, error.remedy, folder.file, number, member) from error
    return table_of(found, 4)


def tie_names(track: NDArray[np.int64]) -> pa.DictionaryArray:
    """Names of tie points (n,) by their numbers."""
    numbers = names_of_numbers(track)
    return pa.DictionaryArray.from_arrays(
        numbers.indices, pc.binary_join_element_wise("tie", numbers.dictionary, "")
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
    first, half = order[differs], len(image) // 2
    count = len(first)
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.cumsum(differs) - 1
    del order, differs
    edges = coo_array((np.ones(half), (place[:half], place[half:])), shape=(count, count))
    track = connected_components(edges, directed=False)[1]
    pair, twice = np.unique(np.column_stack([track, image[first]]), axis=0, return_counts=True)
    doubled = np.zeros(track.max(initial=-1) + 1, dtype=bool)
    doubled[pair[twice > 1, 0]] = True
    good = ~doubled[track]
    order = np.argsort(first[good], kind="stable")
    kept, found = first[good][order], track[good][order]
    _, numbers = np.unique(found, return_inverse=True)
    return kept, numbers.reshape(-1) + 1
