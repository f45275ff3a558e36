"""Names put one after the other are what they were, each kept once, however they are dealt into shares."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tasks.errors import InputError
from tasks.formats import joined_names as joining
from tasks.formats import text_table
from tasks.formats.joined_names import joined_names, room_of_names
from tasks.formats.native_csv import read_csv_image_points

_NAMES = st.lists(st.none() | st.text("ab1é", min_size=1, max_size=30), max_size=12)


def encoded(names: list[str | None]) -> pa.DictionaryArray:
    return pa.array(names, pa.string()).dictionary_encode()


@pytest.mark.parametrize("examples", [25, pytest.param(1_000, marks=pytest.mark.slow)])
def test_each_name_is_kept_once_and_stays_in_its_row(examples: int) -> None:
    @settings(max_examples=examples)
    @given(st.lists(_NAMES, min_size=1, max_size=5), st.sampled_from([1, 2, 3, 500_000]))
    def examine(parts: list[list[str | None]], share: int) -> None:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(joining, "_SHARE", share)
            joined = joined_names([encoded(names) for names in parts])
        joined.validate(full=True)
        assert joined.to_pylist() == [name for names in parts for name in names]
        known = joined.dictionary.to_pylist()
        assert len(set(known)) == len(known)
        if len(parts) > 1:
            assert set(known) == {name for names in parts for name in names} - {None}

    examine()


def test_a_slice_of_names_is_dealt_as_the_names_in_it() -> None:
    names = pa.array([f"point {k:012d}" for k in range(1_000)])
    shares = joining._share_of(names, 7)
    assert set(shares.tolist()) == set(range(7))
    assert (joining._share_of(names.slice(300, 50), 7) == shares[300:350]).all()
    assert room_of_names(names.slice(300, 50)) == 2 * 50 * 18 + 3 * 51 * 4


def test_more_text_than_arrow_takes_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(joining, "_MOST_BYTES", 5)
    with pytest.raises(InputError, match="more than 5 bytes"):
        joined_names([encoded(["abc"]), encoded(["def"])])


@pytest.mark.parametrize(
    ("rows", "taken"),
    [("i,p,1,2\n", False), ("i,{:05d},1,2\n", False), ("image 1,{:05d},1234.567,2345.678\n", True)],
)
def test_columns_take_at_most_twice_the_size_of_their_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: str, taken: bool
) -> None:
    monkeypatch.setattr(text_table, "_BESIDES", 10_000)
    file = tmp_path / "points.csv"
    file.write_text("image,point,x,y\n" + "".join(rows.format(k) for k in range(10_000)))
    if taken:
        assert len(read_csv_image_points(file).line) == 10_000
        return
    with pytest.raises(InputError, match=r"The file has 10,001 rows.*more than twice its size") as refused:
        read_csv_image_points(file)
    assert refused.value.file == file
