"""Formats with a file for each image: no image loses its file to another one."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from urllib.parse import urlparse
from urllib.request import url2pathname

import pytest

from tasks.errors import InputError
from tasks.files.installation import part_of
from tasks.formats.isat import read_isat_cameras, read_isat_exposures
from tasks.formats.register import IMAGE_POINT_FORMATS
from tasks.formats.stac import read_stac_exposures
from tasks.handover.delivery import Angles
from tasks.handover.export import Wanted, write_block
from tasks.handover.formats.register import REGISTER
from tests.tasks.forked import FORK, fails_with_files_of_at_most
from tests.tasks.formats import sound_files as sound
from tests.tasks.formats.packed_files import OPF, packed
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


def test_a_file_of_an_image_may_have_the_longest_name_there_is(tmp_path):
    results, points = flown(Flight())
    names = tuple(f"{k}{'x' * 246}.tif" for k in range(1000, 1004))
    named = replace(results, images=replace(results.images, names=names))
    wanted = Wanted(REGISTER["sure"], "local", Angles())
    written = write_block(named, lambda: points, wanted, tmp_path)
    assert {len(name) for name in written.files if name.startswith("1")} == {254}


@pytest.mark.parametrize("name", ["rpc", "realityscan"])
def test_a_name_that_is_too_long_with_its_ending_is_refused_before_anything_is_written(tmp_path, name):
    """'ä' has two bytes."""
    results, points = flown(Flight())
    names = tuple(f"{k}{'ä' * 124}" for k in range(1000, 1004))
    named = replace(results, images=replace(results.images, names=names))
    form = REGISTER[name]
    with pytest.raises(InputError, match=r"'1000ä{36}…': 2(56|60) bytes"):
        write_block(named, lambda: points, Wanted(form, form.world, Angles()), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_full_disk_leaves_no_part_of_a_file(tmp_path):
    results, points = flown(Flight())
    wanted = Wanted(REGISTER["patb"], "map", Angles())
    assert fails_with_files_of_at_most(10, lambda: write_block(results, lambda: points, wanted, tmp_path))
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_export_has_left_is_removed_by_the_next_one(tmp_path):
    def begin_and_end():
        part_of(tmp_path / "eo.csv").write_text("half")
        os._exit(0)

    process = FORK.Process(target=begin_and_end)
    process.start()
    process.join()
    assert len(list(tmp_path.iterdir())) == 1
    results, points = flown(Flight())
    written = write_block(results, lambda: points, Wanted(REGISTER["patb"], "map", Angles()), tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {*written.files, "HANDOVER.txt"}


@pytest.mark.parametrize("name", ENDINGS)
def test_images_that_would_share_a_file_are_refused(name):
    with pytest.raises(InputError, match=r"'a/1\.tif' and 'b/1\.tif'"):
        files_of(name, ("2.tif", "a/1.tif", "3.tif", "b/1.tif"))


def test_images_of_opf_are_uri_references_as_its_other_programs_read_them(tmp_path):
    """pyopf takes the path of the URI and decodes it; behind "#" is the page of a file."""
    names = ("flight ä/1 #2.tif", "100%20.tif", "D:\\x\\3.tif", "4.tif")
    files = files_of("opf", names)
    uris = [one["uri"] for one in json.loads(files["camera-list.json"])["cameras"]]
    assert [url2pathname(urlparse(uri).path) for uri in uris[:2]] == list(names[:2])
    assert uris[2:] == list(names[2:])
    (tmp_path / "a.zip").write_bytes(packed(files))
    found = IMAGE_POINT_FORMATS["opf"](tmp_path / "a.zip").image.to_pylist()
    assert set(found) == {"1 #2.tif", "100%20.tif", "3.tif", "4.tif"}
    pages = (
        files["camera-list.json"].replace(uris[0], "a%20b.tif#page=1").replace(uris[1], "a%20b.tif#page=2")
    )
    (tmp_path / "a.zip").write_bytes(packed({**files, "camera-list.json": pages}))
    found = IMAGE_POINT_FORMATS["opf"](tmp_path / "a.zip").image.to_pylist()
    assert {"a b.tif#page=1", "a b.tif#page=2"} < set(found)


def test_images_of_stac_are_uri_references(tmp_path):
    files = files_of("stac", ("flight ä/1 #2.tif", "2.tif", "3.tif", "4.tif"))
    item = json.loads(files["item_1.json"])
    assert item["assets"]["image"]["href"] == "flight%20%C3%A4/1%20%232.tif"
    (tmp_path / "item.json").write_text(files["item_1.json"])
    assert read_stac_exposures(tmp_path / "item.json", "omega-phi-kappa").image.to_pylist() == ["1 #2.tif"]


#: Block exchange by paths of files → the file of image points.
BY_FILE = {"blocks-exchange": "block.xml", "opf": "block.zip"}


@pytest.mark.parametrize("name", BY_FILE)
def test_image_points_of_files_of_one_name_in_two_folders_are_not_one_image(name, tmp_path):
    """As the heads of a camera number their images; orientations of both would be refused, too."""
    file = tmp_path / BY_FILE[name]
    for names in (("a/1.tif", "2.tif", "b/3.tif", "4.tif"), ("a/1.tif", "2.tif", "b/1.tif", "4.tif")):
        files = files_of(name, names)
        file.write_bytes(packed(files) if name == "opf" else files["block.xml"].encode())
        if names[2] == "b/3.tif":
            assert len(set(IMAGE_POINT_FORMATS[name](file).image.to_pylist())) == 4
    with pytest.raises(InputError, match=r"Two images are called '1\.tif'"):
        IMAGE_POINT_FORMATS[name](file)


_MARKERS = """<chunk><cameras><camera id="7" label="a.tif"><transform>1</transform></camera>
<camera id="8" label="a.tif"/></cameras><markers><marker id="0" label="g1"/></markers><frames><frame><markers>
<marker marker_id="0"><location camera_id="8" pinned="true" x="1" y="2"/></marker></markers></frame></frames>
</chunk>"""
_SAME_NAME = {
    "blocks-exchange": sound._BLOCKS.replace(">7</PhotoId>", ">8</PhotoId>").replace("b.tif", "E:\\c\\a.tif"),
    "opf": packed(
        {name: text.replace('"camera_id": 7', '"camera_id": 8') for name, text in OPF.items()}
        | {
            "p/camera-list.json": OPF["p/camera-list.json"].replace(
                "[{", '[{"id": 8, "uri": "file:///c:/b/IMG 1.tif"}, {'
            )
        }
    ),
    "openmvg": sound._OPENMVG.replace(
        '"views": [{', '"views": [{"key": 1, "value": {"ptr_wrapper": {"data": {"filename": "a.tif", '
        '"id_view": 1, "id_pose": 1, "id_intrinsic": 0}}}}, {',
    ).replace('"observations": [{"key": 0', '"observations": [{"key": 1'),
    "metashape-markers": _MARKERS,
}  # fmt: skip


@pytest.mark.parametrize("name", _SAME_NAME)
def test_an_image_with_points_does_not_get_the_orientation_of_one_of_the_same_name(name, tmp_path):
    """Of two files of one name, one is oriented, and the other one has the image points."""
    file = tmp_path / "file"
    text = _SAME_NAME[name]
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match="Two images are called"):
        IMAGE_POINT_FORMATS[name](file)


def test_two_images_of_one_number_are_refused(tmp_path):
    file = tmp_path / "file"
    file.write_text(sound._BLOCKS.replace("<Id>8</Id>", "<Id>7</Id>").replace(">8</PhotoId>", ">7</PhotoId>"))
    with pytest.raises(InputError, match=r"'a\.tif' has the same number, 7"):
        IMAGE_POINT_FORMATS["blocks-exchange"](file)


def test_stac_items_of_numbered_frames_have_different_identifiers():
    files = files_of("stac", ("101.0001", "101.0002", "7_0003.tif", "7_0004.tif"))
    found = [json.loads(files[f"item_{k}.json"])["id"] for k in range(1, 5)]
    assert found == ["101.0001", "101.0002", "7_0003", "7_0004"]


def test_stac_items_of_files_of_one_name_in_two_folders_have_different_identifiers():
    files = files_of("stac", ("a/1.tif", "2.tif", "b/1.tif", "b/3.tif"))
    found = [json.loads(files[f"item_{k}.json"])["id"] for k in range(1, 5)]
    assert found == ["a/1.tif", "2.tif", "b/1.tif", "b/3.tif"]


def test_photos_strips_and_cameras_of_isat_stay_different_and_have_a_table(tmp_path):
    names = ("1 a", "1_a", "2 a", "1 a.tif")
    results, points = flown(Flight(corrections=True))
    cameras = tuple(
        replace(one, frame=replace(one.frame, name=name))
        for one, name in zip(results.cameras, ("UC A", "UC_A"), strict=True)
    )
    results = replace(
        results, images=replace(results.images, names=names), cameras=cameras, strips=("s 1", "s_1", "1", "")
    )
    files = REGISTER["isat"].write(delivered(results, points, "isat"))
    for name in ("photo", "camera"):
        (tmp_path / name).write_text(files[name])
    photos = read_isat_exposures(tmp_path / "photo", "omega-phi-kappa")
    assert photos.image.to_pylist() == ["1_a_2", "1_a", "2_a", "1_a.tif"]
    assert photos.strip.to_pylist() == ["s_1_2", "s_1", "1", "2"]
    assert photos.camera.to_pylist() == ["UC_A_2", "UC_A"] * 2
    assert list(read_isat_cameras(tmp_path / "camera")) == ["UC_A_2", "UC_A"]
    groups = [line for line in files["ideal_from_measured.dat"].splitlines() if "camera_name" in line]
    assert groups == [' camera_name: "UC_A_2"', ' camera_name: "UC_A"']
    assert files["isat_images.csv"].splitlines()[1] == "1_a_2,1 a"
    assert files["isat_strips.csv"].splitlines()[1] == "s_1_2,s 1"
