"""Names found among others, whichever of them are many."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tasks.tables.places import Texts, distinct, places_of

_AMONG = ("b", "", "ä", "a", "point 7", "𝔸")


@pytest.mark.parametrize("kind", [tuple, list, lambda names: pd.Series(names, dtype="str")])
@pytest.mark.parametrize("times", [1, 100])
def test_every_name_has_the_index_of_itself_and_a_strange_one_none(kind: type, times: int) -> None:
    more = [f"more {i}" for i in range(40 * times)]
    among: Texts = kind([*_AMONG, *more])
    names: Texts = kind(["a", "strange", "𝔸", "a", ""])
    assert places_of(names, among).tolist() == [3, -1, 5, 3, 1]
    # As many names as there are others are looked for in another way.
    assert np.array_equal(places_of(among, among), np.arange(len(among)))


def test_without_names_there_are_no_places() -> None:
    assert places_of((), _AMONG).tolist() == []
    assert places_of(("a",), ()).tolist() == [-1]


def test_distinct_names_are_in_the_order_of_their_code_points() -> None:
    names = pd.Series(["b", "ä", "a", "b", "𝔸", "\ufffd", "Z"], dtype="str")
    assert distinct(names) == tuple(sorted(set(names)))


def test_categories_have_the_places_of_their_texts():
    texts = pd.Series(["b", None, "a", "b", "zz", "c"])
    names = texts.astype(pd.CategoricalDtype(["zz", "c", "unused", "b", "a"]))
    among = ("a", "unused", "b", "c")
    assert places_of(names, among).tolist() == [2, -1, 0, 2, -1, 3]
    assert distinct(names) == distinct(texts) == ("a", "b", "c", "zz")
