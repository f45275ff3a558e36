"""Formats with a file for each image: no image loses its file to another one."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from tasks.errors import InputError
from tasks.handover.formats.register import REGISTER
from tests.tasks.handover.flown_block import Flight, delivered, flown

#: Format → ending of the file of an image.
ENDINGS = {"rpc": "_RPC.TXT", "sure": ".ori", "realityscan": ".xmp"}


def files_of(name, names):
    results, points = flown(Flight())
    renamed = replace(results, images=replace(results.images, names=names))
    delivery = replace(delivered(results, points, name), results=renamed)
    return REGISTER[name].write(delivery)


@pytest.mark.parametrize("name", ENDINGS)
def test_numbers_behind_a_point_are_no_ending_of_a_file(name):
    files = files_of(name, ("101.0001", "101.0002", "7_0003.tif", "flight 2/7_0004.jp2"))
    for stem in ("101.0001", "101.0002", "7_0003", "7_0004"):
        assert f"{stem}{ENDINGS[name]}" in files


@pytest.mark.parametrize("name", ENDINGS)
def test_images_that_would_share_a_file_are_refused(name):
    with pytest.raises(InputError, match=r"'a/1\.tif' and 'b/1\.tif'"):
        files_of(name, ("2.tif", "a/1.tif", "3.tif", "b/1.tif"))


def test_stac_items_of_numbered_frames_have_different_identifiers():
    files = files_of("stac", ("101.0001", "101.0002", "7_0003.tif", "7_0004.tif"))
    found = [json.loads(files[f"item_{k}.json"])["id"] for k in range(1, 5)]
    assert found == ["101.0001", "101.0002", "7_0003", "7_0004"]
