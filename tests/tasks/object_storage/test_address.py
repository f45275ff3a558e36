"""Addresses on object storage: what is one, what is a folder, what is refused without being repeated."""

from __future__ import annotations

from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.object_storage.address import (
    ObjectAddress,
    address_of,
    output_place,
)
from tasks.object_storage.connection import WORKSPACES_VARIABLE, local_folder


@pytest.mark.parametrize(
    ("text", "bucket", "prefix"),
    [
        ("s3://surveys/block-42", "surveys", "block-42"),
        ("s3://surveys/2026/block 42/", "surveys", "2026/block 42"),
        ("S3://surveys.example/Süd/µ", "surveys.example", "Süd/µ"),
    ],
)
def test_an_address_is_a_bucket_and_a_prefix(text: str, bucket: str, prefix: str) -> None:
    assert output_place(text) == ObjectAddress(bucket, prefix)
    assert address_of(str(address_of(text))) == address_of(text)


@pytest.mark.parametrize("text", ["results", "../s3", "/data/s3:/x", "~/s3", "."])
def test_everything_else_is_a_folder(text: str) -> None:
    assert output_place(text) == Path(text)


@pytest.mark.parametrize(
    "text",
    [
        "s3:/surveys/block",
        "s3://surveys",
        "s3://surveys/",
        "s3:///block",
        "s3://Surveys/block",
        "s3://surveys/../other",
        "s3://surveys/a//b",
        "s3://surveys/a/./b",
        "s3://surveys/a\\b",
        "s3://surveys/a#b",
        "s3://surveys/a\nb",
        "s3://surveys/" + "a" * 800,
        "gs://surveys/block",
        "https://surveys.example/block",
    ],
)
def test_what_is_no_address_is_refused_with_the_form_of_one(text: str) -> None:
    with pytest.raises(InputError) as refused:
        output_place(text)
    assert (
        "s3://" in refused.value.remedy or "bytes" in refused.value.remedy or "parts" in refused.value.remedy
    )


@pytest.mark.parametrize(
    "text",
    [
        "s3://KEY:geheim@surveys/block",
        "s3://geheim@surveys/block",
        "s3://surveys:geheim/block",
        "s3://surveys/block?secret_key=geheim",
    ],
)
def test_credentials_in_an_address_are_refused_and_not_repeated(text: str) -> None:
    with pytest.raises(InputError) as refused:
        output_place(text)
    assert "geheim" not in str(refused.value)
    assert "AWS_SECRET_ACCESS_KEY" in refused.value.remedy


def test_a_place_further_down_cannot_lead_up() -> None:
    address = ObjectAddress("surveys", "2026")
    assert address.below("block 42", "results") == ObjectAddress("surveys", "2026/block 42/results")
    for part in ("..", "", "a/../b", "a?b"):
        with pytest.raises(InputError):
            address.below(part)


def test_every_address_and_server_has_a_local_folder_of_its_own(tmp_path: Path) -> None:
    here = {WORKSPACES_VARIABLE: str(tmp_path)}
    other = {**here, "AWS_ENDPOINT_URL": "http://127.0.0.1:9000"}
    one, two = ObjectAddress("surveys", "a/b"), ObjectAddress("surveys", "a-b")
    folders = [local_folder(one, here), local_folder(two, here), local_folder(one, other)]
    assert len(set(folders)) == 3
    assert all(folder.parent == tmp_path and folder.name.startswith("a-b-") for folder in folders)
    assert local_folder(one, here) == folders[0]


@pytest.mark.parametrize("text", ["", "  ", "\t"])
def test_a_blank_output_folder_is_not_the_current_one(text: str) -> None:
    with pytest.raises(InputError, match="The output folder is blank"):
        output_place(text)


@pytest.mark.parametrize(
    "text", ["x" * 256, "é" * 128, "x/" * 2_000, "a\0b", "a\nb", "a\x1b[2J", "a\udcff", "\u202e"]
)
def test_no_folder_has_such_a_name(text: str) -> None:
    with pytest.raises(InputError, match="Name another folder"):
        output_place(text)
