"""Block exchange: what every format writes and its reader reads is the same block, to the stated precision.

A format joins by a row in `READ`; without one the first test fails. Compared are image points, with their
names as the tables beside the files give them back, control, cameras over their whole format, and
orientations where the format has our own.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from tasks.formats.meanings import IMAGE_POINT_MEANINGS
from tasks.formats.records import ImagePointRecords
from tasks.formats.register import CAMERA_FORMATS, CONTROL_FORMATS, EXPOSURE_FORMATS, IMAGE_POINT_FORMATS
from tasks.handover.block_points import BlockPoints
from tasks.handover.delivery import Delivery
from tasks.handover.formats.exchange import EXCHANGE
from tasks.handover.results import Results
from tests.tasks.formats.packed_files import packed
from tests.tasks.handover.flown_block import NAMES, Flight, delivered, flown
from tests.tasks.handover.test_ground_through_files import in_pixels, poses, seen

WHOLE = "block.zip"


@dataclass(frozen=True)
class Read:
    """How a format of the register is read again.

    Attributes
    ----------
    reader : name in the registers of readers.
    image_points, orientations, cameras : files; empty where the format has none, or none of its own.
    control : files of control points, and of check points where they are others.
    image_point_um : half of the last digit that is printed, or what float32 leaves.
    control_m : likewise; a frame about the block has more digits than a map.
    position_m, rotation : of the orientations.
    camera_um : likewise, over the format, beside the misfit that the writer states.
    unit : of image points, where the format does not fix it.
    names : tables of names that it changes: file, column there.
    incomplete : whether a control point may lack a coordinate.
    control_reader : where it is another one.
    """

    reader: str
    image_points: str
    orientations: str = ""
    cameras: str = ""
    control: tuple[str, ...] = ()
    image_point_um: float = 0.0
    control_m: float = 0.0
    position_m: float = 1e-9
    rotation: float = 1e-14
    camera_um: float = 1e-6
    unit: str = ""
    names: tuple[tuple[str, str], ...] = ()
    incomplete: bool = False
    control_reader: str = ""

    @property
    def reader_of_control(self) -> str:
        return self.control_reader or self.reader


READ = {
    "blocks-exchange": Read(
        "blocks-exchange", "block.xml", "block.xml", "block.xml", ("block.xml",),
        image_point_um=2e-4, control_m=1e-6, position_m=1e-6, rotation=1e-14,
        names=(("tie_points.csv", "point_there"),),
    ),
    "colmap": Read(
        "colmap", "images.txt", "images.txt", "cameras.txt",
        image_point_um=2e-4, position_m=1e-8, rotation=1e-13,
        names=(("points.csv", "POINT3D_ID"), ("images.csv", "image_there")),
    ),
    "opensfm": Read(
        "opensfm", "tracks.csv", "reconstruction.json", "reconstruction.json",
        ("gcp_list.txt", "gcp_check_list.txt"),
        image_point_um=6e-5, control_m=2e-6, position_m=1e-7, control_reader="odm-gcp",
    ),
    "opf": Read(
        "opf", WHOLE, WHOLE, WHOLE, (WHOLE,),
        image_point_um=4e-3, control_m=1e-8, names=(("tie_points.csv", "point_there"),),
    ),
    "openmvg": Read(
        "openmvg", "sfm_data.json", "sfm_data.json", "sfm_data.json",
        image_point_um=1e-6, names=(("openmvg_points.csv", "number"),),
    ),
    "patb": Read(
        "patb", "patb.im", control=("patb.con", "patb_check.con"),
        image_point_um=6e-5, control_m=6e-5, unit="um", incomplete=True,
        names=(("patb_points.csv", "number"), ("patb_images.csv", "photo")),
    ),
    "bingo": Read(
        "bingo", "image.dat", control=("geoin.dat",),
        image_point_um=6e-5, control_m=6e-5, unit="mm",
        names=(("bingo_points.csv", "point_there"), ("bingo_images.csv", "image_there")),
    ),
    "corrected-csv": Read(
        "csv", "image_points.csv", cameras="cameras.csv", control=("control_points.csv",),
        image_point_um=6e-5, control_m=6e-5, unit="mm", incomplete=True,
    ),
}  # fmt: skip
CASES = [Flight(), Flight(2000.0, 45.0), Flight(corrections=True), Flight(rig=True)]
IDS = ["forward distortion", "oblique", "correction polynomials", "rig"]


@dataclass(frozen=True, eq=False)
class Written:
    """A block in a format, in a folder."""

    results: Results
    points: BlockPoints
    delivery: Delivery
    folder: Path
    read: Read

    def names(self, what: str) -> dict[str, str]:
        """Names there → names of the block, of all points or images that the format renames."""
        for file, column in self.read.names:
            if (self.folder / file).exists():
                with (self.folder / file).open(encoding="utf-8") as stream:
                    rows = list(csv.DictReader(stream))
                if what in rows[0]:
                    return {row[column]: row[what] for row in rows}
        return {}


@pytest.fixture(params=CASES, ids=IDS, scope="module")
def block(request: pytest.FixtureRequest) -> tuple[Results, BlockPoints]:
    return flown(request.param)


@pytest.fixture(params=EXCHANGE, scope="module")
def written(block, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Written:
    delivery, folder = delivered(*block, request.param), tmp_path_factory.mktemp("written")
    files = EXCHANGE[request.param].write(delivery)
    for file, content in files.items():
        (folder / file).write_bytes(content if isinstance(content, bytes) else content.encode())
    (folder / WHOLE).write_bytes(packed(files))
    return Written(*block, delivery, folder, READ[request.param])


def test_every_format_of_the_register_is_read_again():
    assert set(READ) == set(EXCHANGE)
    for name, read in READ.items():
        assert read.reader in IMAGE_POINT_FORMATS
        # What a reader of the register can read of a format is compared.
        assert bool(read.cameras) == (read.reader in CAMERA_FORMATS), name
        assert bool(read.control) == (read.reader_of_control in CONTROL_FORMATS), name


def test_image_points_are_those_that_were_measured(written: Written):
    records = IMAGE_POINT_FORMATS[written.read.reader](written.folder / written.read.image_points)
    points, cameras = written.points, written.results.cameras
    named_points, named_images = written.names("point"), written.names("image")
    found = {
        (named_images.get(image, image), named_points.get(point.removeprefix("cp"), point)): xy
        for image, point, xy in zip(
            records.image.to_pylist(), records.point.to_pylist(), _millimetres(written, records), strict=True
        )
    }
    assert len(found) == len(records.line) == len(points.xy)
    expected = points.xy.copy()
    for number, camera in enumerate(cameras):
        own = written.results.images.camera[points.image] == number
        if EXCHANGE_OF[written.read.reader].corrected:
            expected[own] = camera.corrected(points.xy[own])
        if written.read.reader == "csv":
            expected[own] += camera.frame.principal_point
    for image, point, xy in zip(points.image, points.point, expected, strict=True):
        away = 1e3 * found[NAMES[image], points.names[point]] - 1e6 * xy
        assert np.abs(away).max() < written.read.image_point_um + 1e-7


EXCHANGE_OF = {READ[name].reader: form for name, form in EXCHANGE.items()}


def _millimetres(written: Written, records: ImagePointRecords) -> np.ndarray:
    """Image points (m, 2) in the image system; of a block whose cameras have the same pixels and format."""
    frame = written.results.cameras[0].frame
    meaning = IMAGE_POINT_MEANINGS.get(written.read.reader)
    unit = written.read.unit or (meaning.unit if meaning else "")
    if unit == "px":
        assert meaning is not None
        shift = 0.5 if meaning.origin == "centre" else 0.0
        half = 0.5 * np.array([frame.columns, frame.rows])
        return (records.xy + shift - half) * [1.0, -1.0] * frame.pixel_size * 1e3
    scale = {
        "mm": 1.0,
        "um": 1e-3,
        "longer-side": max(frame.columns, frame.rows) * frame.pixel_size * 1e3,
    }[unit]
    return records.xy * scale


def test_control_is_as_it_was_surveyed(written: Written):
    if not written.read.control:
        pytest.skip("the format has no control")
    surveyed, names = written.points.surveyed, written.names("point")
    found = {}
    for file in written.read.control:
        records = CONTROL_FORMATS[written.read.reader_of_control](written.folder / file)
        where = records.position
        if records.states.crs is not None and records.states.crs != "local":
            frame = written.results.images.frame
            where = frame.from_geodetic(np.column_stack([np.radians(where[:, 1::-1]), where[:, 2]]))
        role = ["check" if "check" in file else one for one in records.role.to_pylist()]
        found |= {
            names.get(point, point).removeprefix("CHK-"): (xyz, one)
            for point, xyz, one in zip(records.point.to_pylist(), where, role, strict=True)
        }
    in_map = EXCHANGE_OF[written.read.reader].lens == ()
    given = surveyed.in_map if in_map else surveyed.local
    complete = np.isfinite(surveyed.in_map).all(axis=1)
    wanted = [k for k in range(len(surveyed.names)) if complete[k] or written.read.incomplete]
    assert set(found) == {surveyed.names[k] for k in wanted}
    for k in wanted:
        xyz, role = found[surveyed.names[k]]
        np.testing.assert_allclose(xyz, given[k], rtol=0, atol=written.read.control_m)
        assert (role == "check") == surveyed.check[k]


def test_cameras_see_as_they_did_over_their_whole_format(written: Written):
    if not written.read.cameras:
        pytest.skip("the format has no camera that is read")
    found = CAMERA_FORMATS[written.read.reader](written.folder / written.read.cameras)
    assert len(found) == len(written.results.cameras)
    if not written.delivery.lenses.models:
        # Without distortion, for corrected image points; seven decimals of a millimetre.
        for read, ours in zip(found.values(), written.results.cameras, strict=True):
            frame, lengths = ours.frame, np.array([ours.frame.focal_length, *ours.frame.principal_point])
            assert (read.columns, read.rows, read.additional_parameters) == (frame.columns, frame.rows, {})
            found_mm = [read.focal_length_mm, *read.principal_point_mm]
            np.testing.assert_allclose(found_mm, 1e3 * lengths, rtol=0, atol=1e-7)
            assert read.pixel_um == pytest.approx(1e6 * frame.pixel_size)
        return
    for read, ours, model in zip(
        found.values(), written.results.cameras, written.delivery.lenses.models, strict=True
    ):
        frame = ours.frame
        camera = in_pixels(read)
        assert (camera.columns, camera.rows) == (frame.columns, frame.rows)
        steps = np.stack(np.meshgrid(*2 * [np.linspace(-1.0, 1.0, 17)]), axis=-1).reshape(-1, 2)
        measured = steps * frame.half_format
        ideal = ours.corrected(measured) / frame.focal_length
        ground = np.column_stack([ideal, -np.ones(len(ideal))])
        there = seen(camera, np.zeros(3), np.eye(3), ground)
        here = (measured * [1.0, -1.0] + frame.half_format) / frame.pixel_size
        away_um = 1e6 * frame.pixel_size * np.linalg.norm(there - here, axis=1).max()
        assert away_um < 1.1 * model.misfit_um + written.read.camera_um


def test_orientations_are_ours_where_the_world_is(written: Written):
    if not written.read.orientations:
        pytest.skip("the orientations are fitted to another world: test_read_back has them in ours")
    records = EXPOSURE_FORMATS[written.read.reader](
        written.folder / written.read.orientations, "omega-phi-kappa"
    )
    centre, turn = poses(written.results, records)
    images, names = written.results.images, written.names("image")
    listed = [names.get(name, name) for name in records.image.to_pylist()]
    order = [listed.index(one) for one in NAMES]
    np.testing.assert_allclose(centre[order], images.projection_centre, rtol=0, atol=written.read.position_m)
    np.testing.assert_allclose(turn[order], images.local_from_camera, rtol=0, atol=written.read.rotation)


def test_lists_of_opendronemap_have_marks_and_positions(tmp_path: Path):
    results, points = flown(Flight())
    images = replace(results.images, names=tuple(name.replace(" ", "_") for name in NAMES))
    files = EXCHANGE["opensfm"].write(delivered(replace(results, images=images), points, "opensfm"))
    for file in ("gcp_list.txt", "gcp_check_list.txt", "geo.txt"):
        (tmp_path / file).write_text(str(files[file]))
    frame, corner = results.cameras[0].frame, np.array([-1.0, 1.0])
    # Its own program takes every point of the first list as control, whatever its name.
    for file, name, image, k in (
        ("gcp_list.txt", "P 3", "1_a.tif", 3),
        ("gcp_check_list.txt", "CHK-P80", "0002.tif", 80),
    ):
        marks = IMAGE_POINT_FORMATS["odm-gcp"](tmp_path / file)
        assert (marks.point.to_pylist(), marks.image.to_pylist()) == ([name], [image])
        seen_at = (marks.xy + 0.5) * frame.pixel_size * [1.0, -1.0] + corner * frame.half_format
        np.testing.assert_allclose(seen_at, points.xy[points.point == k], atol=3e-10)
    records = EXPOSURE_FORMATS["odm-geo"](tmp_path / "geo.txt", "omega-phi-kappa")
    centre, _ = poses(results, records)
    assert records.image.to_pylist() == list(images.names)
    np.testing.assert_allclose(centre, images.projection_centre, atol=2e-6)
