"""Names are text, verbatim: what looks like a number, a missing value or a date is a name as any other."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pyarrow as pa
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tasks.errors import InputError
from tasks.formats.ign_text import read_ign_app, read_ign_mes, read_ign_opk
from tasks.formats.native_csv import read_csv_control, read_csv_exposures, read_csv_image_points
from tasks.formats.register import CAMERA_FORMATS, EXPOSURE_FORMATS
from tasks.plain_text import LONGEST_NAME, trouble_in
from tests.tasks.formats.packed_files import CALIBRATION, MICMAC_ORIENTATIONS, packed
from tests.tasks.formats.sound_files import SOUND

#: Names that something on the way may take for a number, nothing, or each other.
TRICKY = (
    "12", "012", "0012", "+12", "12.0", "12.", "1e5", "100000", "1E5", "-0", "0", "00", "0x10", "1_000", "٣",
    "nan", "NaN", "NA", "N/A", "null", "NULL", "None", "inf", "-inf", "true", "True", "TRUE", "#N/A", "<NA>",
    "2024-05-02", "1/2", "p1", "P1", "ß", "SS", "ss", "a b", "a  b", "Ä", "A\u0308", "1" * 40, "9" * 39 + "8",
)  # fmt: skip

blank_free = st.one_of(
    st.sampled_from([name for name in TRICKY if " " not in name]),
    st.text(
        st.characters(min_codepoint=0x21, max_codepoint=0x24F, exclude_characters='"'),
        min_size=1,
        max_size=30,
    ),
    st.integers(0, 10**40).map(str),
    st.integers(0, 9999).map("{:06d}".format),
).filter(lambda name: trouble_in(name) is None and not any(c.isspace() for c in name))
any_name = st.one_of(
    blank_free,
    st.sampled_from(TRICKY),
    st.text(min_size=1, max_size=40).filter(lambda name: name.strip(" \t") == name and bool(name)),
).filter(lambda name: trouble_in(name) is None)
lists = st.lists(any_name, min_size=1, max_size=8)


def written(folder: Path, header: str, rows: list[list[str]]) -> Path:
    file = folder / "table.csv"
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(header.split(","))
        writer.writerows(rows)
    return file


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("names")


@pytest.mark.parametrize("examples", [20, pytest.param(500, marks=pytest.mark.slow)])
def test_csv_readers_keep_every_name(folder: Path, examples: int) -> None:
    @settings(max_examples=examples)
    @example(names=list(TRICKY))
    @given(names=lists)
    def examine(names: list[str]) -> None:
        rows = [[name, name, "1", "2"] for name in names]
        points = read_csv_image_points(written(folder, "image,point,x,y", rows))
        assert points.image.to_pylist() == points.point.to_pylist() == names
        control = read_csv_control(written(folder, "point,x,y,z", [[name, "1", "2", "3"] for name in names]))
        assert control.point.to_pylist() == names
        rows = [[*[name] * 4, *"123456"] for name in names]
        header = "image,camera,strip,flight,x,y,z,omega,phi,kappa"
        exposures = read_csv_exposures(written(folder, header, rows), "omega-phi-kappa")
        for column in (exposures.image, exposures.camera, exposures.strip, exposures.flight):
            assert isinstance(column, pa.Array)
            assert column.to_pylist() == names

    examine()


@pytest.mark.parametrize("examples", [20, pytest.param(500, marks=pytest.mark.slow)])
def test_ign_readers_keep_every_name(folder: Path, examples: int) -> None:
    file = folder / "table.txt"

    @settings(max_examples=examples)
    @example(names=[name for name in TRICKY if " " not in name])
    @given(names=st.lists(blank_free, min_size=1, max_size=8))
    def examine(names: list[str]) -> None:
        encodable = [name for name in names if _in_latin(name)] or ["0012"]
        file.write_text("".join(f"{name} {name} 1.5 2.5\n" for name in encodable), encoding="utf-8")
        points = read_ign_mes(file)
        assert points.point.to_pylist() == points.image.to_pylist() == encodable
        file.write_text("".join(f"{name} 3 1.5 2.5 3.5\n" for name in encodable), encoding="utf-8")
        assert read_ign_app(file).point.to_pylist() == encodable
        file.write_text("".join(f"{name} 1 2 3 4 5 6 {name}\n" for name in encodable), encoding="utf-8")
        exposures = read_ign_opk(file, "omega-phi-kappa")
        assert exposures.image.to_pylist() == exposures.camera.to_pylist() == encodable

    examine()


def _in_latin(name: str) -> bool:
    """Whether a name is the same in every encoding these files have."""
    return name.isascii() and len(name) <= LONGEST_NAME


def _with_another(kind: str, text: str, begin: str, end: str, old: str, new: str) -> tuple[str, str, str]:
    """Files of a format with its camera twice, the same and with another focal length."""
    camera = text[text.index(begin) : text.index(end) + len(end)]
    assert old in camera
    return (
        kind,
        text.replace(camera, camera + "\n" + camera),
        text.replace(camera, camera + "\n" + camera.replace(old, new)),
    )


@pytest.mark.parametrize(
    ("kind", "same", "other"),
    [
        _with_another(
            "blocks-exchange", SOUND["camera", "blocks-exchange"], "<Photogroup>", "</Photogroup>",
            "<FocalLength>100<", "<FocalLength>101<",
        ),
        _with_another(
            "inpho", SOUND["camera", "inpho"], "$CAMERA_DEF", "    0 0 0 0\n$END", "100.5\n", "100.6\n"
        ),
        _with_another("isat", SOUND["camera", "isat"], "begin", "end camera_parameters", ": 100", ": 101"),
        (
            "micmac",
            packed({**MICMAC_ORIENTATIONS, "Ori-B/AutoCal1.xml": CALIBRATION}),
            packed({**MICMAC_ORIENTATIONS, "Ori-B/AutoCal1.xml": CALIBRATION.replace("<F>200", "<F>201")}),
        ),
    ],
)  # fmt: skip
def test_a_camera_is_not_replaced_by_another_one_of_its_name(
    folder: Path, kind: str, same: str | bytes, other: str | bytes
) -> None:
    file = folder / "camera"
    file.write_bytes(same if isinstance(same, bytes) else same.encode())
    assert len(CAMERA_FORMATS[kind](file)) == 1
    file.write_bytes(other if isinstance(other, bytes) else other.encode())
    with pytest.raises(InputError, match="Two different cameras have this name"):
        CAMERA_FORMATS[kind](file)


@pytest.mark.parametrize(
    ("old", "new"), [("<FocalLength>100<", "<FocalLength>101<"), ("<Width>", "<Width>1")]
)
def test_photos_of_two_cameras_of_one_name_are_not_taken_for_those_of_one(
    folder: Path, old: str, new: str
) -> None:
    """Also where the project declares the camera, which would replace both."""
    text = SOUND["exposures", "blocks-exchange"]
    assert isinstance(text, str)
    _, same, other = _with_another("blocks-exchange", text, "<Photogroup>", "</Photogroup>", old, new)
    read, file = EXPOSURE_FORMATS["blocks-exchange"], folder / "exposures"
    file.write_text(same)
    assert set(read(file, "omega-phi-kappa").camera.to_pylist()) == {"UC"}
    file.write_text(other)
    with pytest.raises(InputError, match="Two different cameras have this name"):
        read(file, "omega-phi-kappa")


def test_photos_of_a_camera_whose_numbers_are_written_in_two_ways_are_of_one_camera(folder: Path) -> None:
    """100 and 100.0; and its parts in another order."""
    text = SOUND["exposures", "blocks-exchange"]
    assert isinstance(text, str)
    size = re.search("<Width>.*?</Width>", text)
    assert size is not None
    for old, new in (("<FocalLength>100<", "<FocalLength>1.000e2<"), (size[0], f"\n{size[0]}")):
        _, _, other = _with_another("blocks-exchange", text, "<Photogroup>", "</Photogroup>", old, new)
        assert other.count("<Photogroup>") > 1
        (folder / "exposures").write_text(other)
        found = EXPOSURE_FORMATS["blocks-exchange"](folder / "exposures", "omega-phi-kappa")
        assert set(found.camera.to_pylist()) == {"UC"}
