"""What goes into the key of a stage, and what does not."""

from __future__ import annotations

from datetime import date
from pathlib import Path

import pytest

from tasks.store.artifact import Artifact
from tasks.store.stage_key import differences, library_versions, stage_key


def a_stage(folder: Path, **arguments: object) -> None:
    """Stands for a stage function; only its source matters here."""


def key(**arguments: object) -> str:
    return stage_key("a_stage", a_stage, arguments).digest


def test_the_same_arguments_in_another_order_have_the_same_key() -> None:
    assert key(a=1, b="two") == key(b="two", a=1)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1, 1.0),
        (True, 1),
        ("1", 1),
        (None, "null"),
        ((1, 2), (2, 1)),
        ((), {}),
        ({"a": 1}, {"a": 2}),
        (0.1, 0.1 + 2e-17 * 10),
        ("x" * 64, Artifact("a", Path("a"), "x" * 64, None)),
        (date(2024, 5, 2), "2024-05-02"),
        (date(2024, 5, 2), date(2024, 5, 3)),
    ],
)
def test_different_contents_have_different_keys(one: object, other: object) -> None:
    assert key(value=one) != key(value=other)


def test_path_and_name_of_an_artifact_do_not_count() -> None:
    here = Artifact("a", Path("here/a.parquet"), "d" * 64, 3)
    there = Artifact("b", Path("there/b.parquet"), "d" * 64, 3)
    assert key(table=here) == key(table=there)


def test_the_name_of_the_stage_counts() -> None:
    assert stage_key("one", a_stage, {}).digest != stage_key("other", a_stage, {}).digest


def test_not_a_number_is_refused() -> None:
    with pytest.raises(ValueError, match="JSON"):
        key(value=float("nan"))


def test_the_versions_of_the_numerical_libraries_count() -> None:
    versions = library_versions()
    assert {"numpy", "scipy", "numba", "pyarrow", "pandas", "pyproj", "PROJ", "python"} == set(versions)
    assert stage_key("s", a_stage, {}).parts["versions"] == versions


def test_differences_are_named() -> None:
    old = stage_key("s", a_stage, {"a": 1, "b": 2}).parts
    new = stage_key("s", a_stage, {"a": 1, "b": 3, "c": 4}).parts
    assert differences(old, new) == ("b", "c")
    assert differences(old, {**old, "source": "0"}) == ("source",)
    assert differences(old, old) == ()
