"""What is put on object storage again, and what a list of files may not name."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from tasks.object_storage.storage import StoredObject
from tasks.object_storage.workspace import STAGE_FILE, ListedFile, StageListing

KEY = "0" * 64
FILES = (
    ListedFile(file="a.parquet", sha256="a" * 64, bytes=10),
    ListedFile(file="b.json", sha256="b" * 64, bytes=20),
)
LISTING = StageListing(stage="bundle_adjustment", key=KEY, files=FILES, seconds=1.5)
A, B = f"{'a' * 64}/a.parquet", f"{'b' * 64}/b.json"
COMPLETE = {A: StoredObject(10, 5), B: StoredObject(20, 6), STAGE_FILE: StoredObject(300, 6)}


def put_again(there: dict[str, StoredObject]) -> list[str]:
    return [file.file for file in LISTING.to_be_put(there)]


def test_of_a_complete_output_nothing_is_put_again() -> None:
    assert put_again(COMPLETE) == []


def test_without_its_list_of_files_the_whole_output_is() -> None:
    assert put_again({}) == ["a.parquet", "b.json"]
    assert put_again({A: COMPLETE[A], B: COMPLETE[B]}) == ["a.parquet", "b.json"]


@pytest.mark.parametrize("changed", [StoredObject(9, 5), StoredObject(10, 7)])
def test_an_object_that_was_truncated_or_put_later_is(changed: StoredObject) -> None:
    assert put_again({**COMPLETE, A: changed}) == ["a.parquet"]


def test_a_missing_object_is() -> None:
    assert put_again({A: COMPLETE[A], STAGE_FILE: COMPLETE[STAGE_FILE]}) == ["b.json"]


@pytest.mark.parametrize("name", ["../a.parquet", "/etc/passwd", "a/b", "..", ".", "", "a\\b", "a" * 201])
def test_a_list_from_the_storage_names_plain_files_only(name: str) -> None:
    content = {**LISTING.model_dump(), "files": [{"file": name, "sha256": "a" * 64, "bytes": 1}]}
    with pytest.raises(ValidationError):
        StageListing.model_validate(content)


@pytest.mark.parametrize(("field", "value"), [("stage", "../x"), ("key", "0" * 63 + "/"), ("key", "K" * 64)])
def test_nor_does_it_say_that_it_is_somewhere_else(field: str, value: str) -> None:
    with pytest.raises(ValidationError):
        StageListing.model_validate({**LISTING.model_dump(), field: value})
