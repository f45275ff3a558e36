from __future__ import annotations

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasks.files.toml_text import TomlValue, toml_text

SCALARS = st.one_of(
    st.text(st.characters(codec="utf-8"), max_size=12),
    st.integers(-(2**62), 2**62),
    st.floats(allow_nan=False, allow_infinity=False),
    st.booleans(),
)
KEYS = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), min_size=1, max_size=6)
VALUES: st.SearchStrategy[TomlValue] = st.recursive(
    st.one_of(SCALARS, st.lists(SCALARS, max_size=3)),
    lambda inner: st.one_of(
        st.dictionaries(KEYS, inner, max_size=3),
        st.lists(st.dictionaries(KEYS, inner, max_size=2), min_size=1, max_size=3),
    ),
    max_leaves=12,
)


@given(st.dictionaries(KEYS, VALUES, max_size=4))
def test_what_is_written_is_read_back(content: dict[str, TomlValue]) -> None:
    assert tomllib.loads(toml_text(content)) == content


def test_tables_and_arrays_of_tables_have_headers() -> None:
    text = toml_text({"a": {"b": {"c": 1}}, "d": [{"e": 2.5}, {"e": True}], "f": "g"})
    assert text.splitlines() == [
        'f = "g"', "", "[a.b]", "c = 1", "", "[[d]]", "e = 2.5", "", "[[d]]", "e = true",
    ]  # fmt: skip


def test_what_toml_cannot_hold_is_refused() -> None:
    with pytest.raises(TypeError, match="NoneType"):
        toml_text({"a": [None]})  # type: ignore[list-item]
