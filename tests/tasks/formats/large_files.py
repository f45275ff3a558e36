# ruff: noqa: E501
"""Files of any size in every format: what stands often in it, again and again, with other names and numbers."""

from __future__ import annotations

import io
import sqlite3
import struct
import zipfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import TypeAlias

import numpy as np

from tests.tasks.formats import packed_files as small
from tests.tasks.formats import sound_files as sound
from tests.tasks.formats import test_classical_formats as texts

#: Makes a file of about so many bytes.
Maker: TypeAlias = Callable[[Path, int], None]
_OF_IMAGE, _SHARED = 500, 100
_TURN = "1 0 0 0 1 0 0 0 1"


def image(k: int) -> str:
    """The image of the k-th measurement."""
    return f"21FD_{k // _OF_IMAGE:05d}"


def point(k: int) -> int:
    """The point of the k-th measurement: most are in five images."""
    return _SHARED * (k // _OF_IMAGE) + k % _OF_IMAGE


def xy(k: int) -> str:
    return f"{13.713 * k % 20_000:.3f} {7.317 * k % 12_000:.3f}"


def xyz(k: int) -> str:
    return f"{500_000 + 0.731 * k % 90_000:.3f} {5_300_000 + 0.317 * k % 90_000:.3f} {500 + k % 977}.25"


def repeated(record: Callable[[int], str | bytes], head: str = "", tail: str = "", first: int = 0) -> Maker:
    """A file of these records between head and tail."""

    def make(path: Path, size: int) -> None:
        with path.open("wb") as stream:
            stream.write(head.encode())
            k = first
            while stream.tell() < size - len(tail):
                some = [record(k + more) for more in range(_OF_IMAGE)]
                stream.writelines(one.encode() if isinstance(one, str) else one for one in some)
                k += _OF_IMAGE
            stream.write(tail.encode())

    return make


def counted(
    record: Callable[[int], bytes], head: Callable[[int], bytes], tail: Callable[[int], bytes] | None = None
) -> Maker:
    """A file whose head, and tail, say how many records it has."""

    def make(path: Path, size: int) -> None:
        count = size // len(record(1_000))
        with path.open("wb") as stream:
            stream.write(head(count))
            stream.writelines(record(k) for k in range(count))
            stream.write(tail(count) if tail else b"")

    return make


def in_photo_lists(k: int) -> str:
    begin = ("" if k == 0 else "-99\n") + f"{image(k)} 100.0\n" if k % _OF_IMAGE == 0 else ""
    return f"{begin}{point(k)} {xy(k)}\n"


def up_to(most: int, make: Maker) -> Maker:
    """A smaller file, where more of its entries than any block has are refused."""
    return lambda path, size: make(path, min(size, most))


def between(text: str, begin: str, end: str) -> tuple[str, str, str]:
    """What stands before a passage, the passage, and what stands behind it."""
    first = text.index(begin)
    last = text.index(end, first) + len(end)
    return text[:first], text[first:last], text[last:]


def passage(text: str, begin: str, end: str, change: Callable[[str, int], str], separator: str = "") -> Maker:
    """A file with one of its passages again and again, each changed by its number."""
    head, one, tail = between(text, begin, end)
    return repeated(lambda k: (separator if k else "") + change(one, k), head, tail)


def _inpho_points() -> Maker:
    head, _, tail = between(texts.INPHO, "    t\\ 1 10.5", "{ * }\n    t2 11 21 1.00 2 { * }\n")
    begin = head[head.index("$PHOTO\n") :]

    def record(k: int) -> str:
        new = k % _OF_IMAGE == 0 and k
        start = "  $END_POINTS\n$END\n" + begin.replace("1_0001", image(k)) if new else ""
        return f"{start}    {point(k)} {xy(k)} 1.00 2 {{ * }}\n"

    return repeated(record, head, tail)


def _metashape_markers() -> Maker:
    head = "<document><chunk><cameras>" + "".join(f'<camera id="{k}" label="{k}.tif"/>' for k in range(3_000))
    head += "</cameras><markers>" + "".join(f'<marker id="{k}" label="g{k}"/>' for k in range(_OF_IMAGE))
    head += '</markers><frames><frame id="0"><markers>'

    def record(k: int) -> str:
        start = f'{"</marker>" if k else ""}<marker marker_id="{k // 2_000}">' if k % 2_000 == 0 else ""
        column, row = xy(k).split()
        return f'{start}<location camera_id="{k % 3_000}" pinned="true" x="{column}" y="{row}"/>\n'

    return repeated(record, head, "</marker></markers></frame></frames></chunk></document>")


def _blocks_measurements() -> Maker:
    def one(_: str, k: int) -> str:
        column, row = xy(k).split()
        seen = "".join(
            f"<Measurement><PhotoId>{photo}</PhotoId><x>{column}</x><y>{row}</y></Measurement>"
            for photo in (7, 8)
        )
        return f"<TiePoint>{seen}</TiePoint>\n"

    return passage(sound._BLOCKS, "<TiePoint><", "</TiePoint>", one)


def _colmap_images(points: int) -> Maker:
    def record(k: int) -> bytes:
        numbers = 7 * np.arange(points, dtype=np.uint64) + np.uint64(k)
        table = np.zeros(points, np.dtype([("x", "<f8"), ("y", "<f8"), ("point", "<u8")]))
        table["x"], table["y"], table["point"] = np.arange(points), k, numbers
        pose = struct.pack("<I7dI", k, 1, 0, 0, 0, 1, 2, 3, 1)
        return pose + f"im{k:07d}.tif".encode() + b"\0" + struct.pack("<Q", points) + table.tobytes()

    return counted(record, lambda count: struct.pack("<Q", count))


def _colmap_cameras(path: Path, size: int) -> None:
    counted(
        lambda k: struct.pack("<IiQQ8d", k, 4, 100, 80, 200, 201, 50, 40, 0.1, 0, 0.001, 0),
        lambda count: struct.pack("<Q", count),
    )(path, size)


def _bundler_cameras() -> Maker:
    return counted(
        lambda k: f"500 0 0\n1.00000000 0.00000000 0\n0 1.00000000 0\n0 0 1.00000\n{k:09d} 2 3\n".encode(),
        lambda count: f"# Bundle file v0.3\n{count} 0\n".encode(),
    )


def _bundler_points() -> Maker:
    return counted(
        lambda k: f"{k:07d}.12 2 3\n1 2 3\n3 0 {k:07d} 1.25 2.5 1 {k:07d} -1.5 2.75 2 {k:07d} 3 4\n".encode(),
        lambda count: (
            f"# Bundle file v0.3\n3 {count}\n" + "500 0 0\n1 0 0\n0 1 0\n0 0 1\n1 2 3\n" * 3
        ).encode(),
    )


def _bal() -> Maker:
    camera = "0.1\n0.2\n0.3\n1\n2\n3\n500\n0\n0\n" * 9
    return counted(
        lambda k: f"{k % 9} {k % 9_000} {1.5 * (k % 999):10.4f} -2.5000\n".encode(),
        lambda count: f"9 9000 {count}\n".encode(),
        lambda _: (camera + "1\n2\n3\n" * 9_000).encode(),
    )


def _patb_orientations(k: int) -> str:
    head = f"{k:>16}      0.00000000    712190.65866     -5421.70427      2141.64057\n"
    return head + "".join(texts.PATB.splitlines(keepends=True)[1:])


def packed_with(files: dict[str, str], name: str, record: Callable[[int], str], limit: int) -> Maker:
    """A packed folder with members of this name, whose {} is their number, none larger than the limit."""

    def make(path: Path, size: int) -> None:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
            for member, content in files.items():
                archive.writestr(member, content)
            k, member, written = 0, 0, 0
            while written < size:
                text = io.StringIO()
                while text.tell() < min(limit, size):
                    text.write(record(k))
                    k += 1
                archive.writestr(name.format(member), text.getvalue())
                written, member = written + text.tell(), member + 1

    return make


def _opf(member: str, begin: str, end: str, change: Callable[[str, int], str]) -> Maker:
    """A packed project, one file of which has a passage again and again."""

    def make(path: Path, size: int) -> None:
        inner = path.with_name("member")
        passage(small.OPF[member], begin, end, change, ", ")(inner, min(size, 19_000_000))
        path.write_bytes(small.packed({**small.OPF, member: inner.read_bytes()}))

    return make


def _cameras(path: Path, _size: int) -> None:
    """As many cameras as a table may have."""
    rows = "".join(f"C{k},100,80,5,60.5,0.1,-0.2\n" for k in range(100_000))
    path.write_text("camera,columns,rows,pixel_um,focal_length_mm,x0_mm,y0_mm\n" + rows)


def _stac(path: Path, size: int) -> None:
    """A packed folder of items."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for k in range(size // (len(sound._STAC) + 120)):
            archive.writestr(
                f"{k:06d}.json", sound._STAC.replace("a.tif", f"{k}.tif").replace('"a"', f'"{k}"')
            )


def _database(path: Path, size: int) -> None:
    """Images with a thousand points each, matched with the next one."""
    path.write_bytes(small.colmap_database())
    points = np.random.default_rng(5).uniform(0.0, 5_000.0, (1_000, 6)).astype("<f4")
    matches = np.repeat(np.arange(1_000, dtype="<u4"), 2).tobytes()
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(
            "DELETE FROM images; DELETE FROM keypoints; DELETE FROM two_view_geometries; "
            "DELETE FROM pose_priors"
        )
        for number in range(1, size // (points.nbytes + len(matches) + 300) + 1):
            connection.execute("INSERT INTO images VALUES (?, ?, 1)", (number, image(_OF_IMAGE * number)))
            points += np.float32(0.25)
            connection.execute("INSERT INTO keypoints VALUES (?, 1000, 6, ?)", (number, points.tobytes()))
            if number > 1:
                pair = 2147483647 * (number - 1) + number
                connection.execute("INSERT INTO two_view_geometries VALUES (?, 1000, 2, ?)", (pair, matches))
            connection.execute(
                "INSERT INTO pose_priors VALUES (?, ?, 1, 0, ?, NULL, NULL, 0)",
                (number, number, struct.pack("<3d", 48.5, 9.25, 900.0)),
            )
        connection.commit()


def _database_of(statement: str, values: Callable[[int], tuple[object, ...]], row: int) -> Maker:
    """A database with so many rows of one kind."""

    def make(path: Path, size: int) -> None:
        path.write_bytes(small.colmap_database())
        with closing(sqlite3.connect(path)) as connection:
            connection.executemany(statement, (values(k) for k in range(100, 100 + size // row)))
            connection.commit()

    return make


def _database_of_cameras(path: Path, size: int) -> None:
    """As many cameras as there may be, and images in the rest of the file."""
    _database(path, size)
    values = struct.pack("<8d", 200, 201, 50, 40, 0.1, 0, 0.001, 0)
    with closing(sqlite3.connect(path)) as connection:
        connection.executemany(
            "INSERT INTO cameras VALUES (?, 4, 100, 80, ?, 1)", ((k, values) for k in range(100, 100_000))
        )
        connection.commit()


def _rtklib(k: int) -> str:
    day, second = 1 + k // 86_400 % 28, k % 86_400
    time = f"2020/{1 + k // 2_419_200:02d}/{day:02d} {second // 3600:02d}:{second // 60 % 60:02d}:{second % 60:02d}.000"
    return (
        f"{time}   40.{k % 10**9:09d} -105.147247371  1578.8456   2  11   1.4193   1.3913   2.9108   "
        "0.00   0.00   0.00   0.00   0.0\n"
    )


def _sbet(k: int) -> bytes:
    return struct.pack(
        "<17d", 0.005 * k, 0.85, 0.16, 2e3, 60, -1, 0.1, 0.01, 0.02, 1.5, 0.3, *(0,) * 3, *(0.01,) * 3
    )


def _smrmsg(k: int) -> bytes:
    return struct.pack("<10d", 0.05 * k, *(0.02,) * 3, *(0.005,) * 3, 0.2, 0.2, 0.5)


def _mrk(k: int) -> str:
    return (
        f"{k + 1}\t{300_000 + 0.7 * k % 300_000:.6f}\t[{2264 + k // 400_000}"
        + sound._MRK[sound._MRK.index("]") :]
    )


def _named(old: str) -> Callable[[str, int], str]:
    """The passage with another number in place of this text."""
    return lambda one, k: one.replace(old, f"{old}{k:07d}", 1)


_GIVEN = '{"id": 7, "uri": "file:///c:/a/IMG 1.tif"}'
_CALIBRATED = "p/calibrated-cameras.json"
_ODM = "EPSG:25832\n"
_V2 = "OPENSFM_TRACKS_VERSION_v2\n"
_DOCUMENT_MEMBER = 2_000_000
LARGE: dict[tuple[str, str], Maker] = {
    ("image points", "csv"): repeated(
        lambda k: f"{image(k)},P{point(k)},{xy(k).replace(' ', ',')}\n", "image,point,x,y\n"
    ),
    ("image points", "ign-mes"): repeated(lambda k: f"P{point(k)} {image(k)} {xy(k)}\n"),
    ("image points", "patb"): repeated(in_photo_lists, tail="-99\n"),
    ("image points", "bingo"): repeated(in_photo_lists, tail="-99\n"),
    ("image points", "pix4d"): repeated(in_photo_lists, tail="-99\n"),
    ("image points", "inpho"): _inpho_points(),
    ("image points", "metashape-markers"): _metashape_markers(),
    ("image points", "blocks-exchange"): _blocks_measurements(),
    ("image points", "colmap"): _colmap_images(_OF_IMAGE),
    ("image points", "opensfm"): repeated(
        lambda k: (
            f"{image(k)}\t{point(k)}\t{k % _OF_IMAGE}\t{0.1 + 1e-7 * k:.7f}\t-0.2\t0.001\t1\t2\t3\t-1\t-1\n"
        ),
        _V2,
    ),
    ("image points", "odm-gcp"): repeated(
        lambda k: f"{xyz(k // 9)} {xy(k)} {image(k)}.tif g{k // 9}\n", _ODM
    ),
    ("image points", "bundler"): _bundler_points(),
    ("image points", "opf"): _opf(
        "p/input-control-points.json",
        '{"camera_id": 7, "position_px": [3, 4], "accuracy": 1}',
        "}",
        lambda one, k: one.replace("[3, 4]", f"[{xy(k).replace(' ', ', ')}]"),
    ),
    ("image points", "openmvg"): passage(
        sound._OPENMVG, '{"key": 7, "value": {"X"', "}]}}", lambda one, k: one.replace("7", f"{k}", 1), ", "
    ),
    ("image points", "micmac"): packed_with(
        {},
        "Homol/Pastisim{0}.tif/jm{0}.tif.txt",
        lambda k: f"{xy(k)} {xy(k + 77)} 1.000000\n",
        _DOCUMENT_MEMBER,
    ),
    ("image points", "bal"): _bal(),
    ("image points", "colmap-database"): _database,
    ("exposures", "csv"): passage(sound._EO, "I1", "\n", _named("I1")),
    ("exposures", "ign-opk"): repeated(lambda k: f"I{k:07d} {xyz(k)} 0.1 0.2 0.3 C\n"),
    ("exposures", "applanix"): passage(
        sound._APPLANIX, "17657707", "-87.3\n", lambda one, k: one.replace("17657707", f"{k:08d}")
    ),
    ("exposures", "patb"): repeated(_patb_orientations),
    ("exposures", "bingo"): repeated(lambda k: f"ORIA {k} {xyz(k)} 1.5 2.5 100.0 CAM1\n"),
    ("exposures", "inpho"): passage(texts.INPHO, "$PHOTO\n", "$END_POINTS\n$END\n", _named("1_")),
    ("exposures", "isat"): passage(
        texts.ISAT.replace("1_0001\tstrip_id", "1_0001 strip_id"),
        "begin photo_parameters",
        "end photo_parameters\n",
        _named("1_"),
    ),
    ("exposures", "metashape-opk"): passage(sound._OPK, "a b", "\n", _named("a b")),
    ("exposures", "metashape"): passage(sound._METASHAPE, "<camera id", "</camera>", _named('label="a')),
    ("exposures", "pix4d"): repeated(
        lambda k: f"IMG {k}.JPG {xyz(k)} 0.1 -0.2 89.7\n", "imageName X Y Z Omega Phi Kappa\n"
    ),
    ("exposures", "blocks-exchange"): passage(sound._BLOCKS, "<Photo><Id>7", "</Photo>", _named("img\\a")),
    ("exposures", "colmap"): _colmap_images(3),
    ("exposures", "opensfm"): passage(sound._RECONSTRUCTION, '"a": {"rotation"', '"c"}', _named('"a'), ", "),
    ("exposures", "odm-geo"): repeated(lambda k: f"a{k}.jpg 11.5{k:07d} 48.{k:07d} 600.25\n", "WGS84\n"),
    ("exposures", "bundler"): _bundler_cameras(),
    ("exposures", "opf"): _opf(
        _CALIBRATED, '{"id": 7, "sensor_id"', "30.0]}", lambda one, k: one.replace("10.5", f"{k + 0.5}")
    ),
    ("exposures", "openmvg"): passage(
        sound._OPENMVG,
        '{"key": 0, "value": {"polymorphic_id": 1073741824',
        "}}}}",
        lambda one, k: one.replace("a.tif", f"a{k:06d}.tif"),
        ", ",
    ),
    ("exposures", "micmac"): packed_with(
        {},
        "Ori-A/Orientation-im{}.tif.xml",
        lambda _: small.MICMAC_ORIENTATIONS["Ori-A/Orientation-a b.tif.xml"],
        1,
    ),
    ("exposures", "bal"): _bal(),
    ("exposures", "colmap-database"): _database_of(
        "INSERT INTO pose_priors VALUES (?, 2, 1, 0, ?, NULL, NULL, 0)",
        lambda k: (k, struct.pack("<3d", 48.5, 9.25, 900.0)),
        38,
    ),
    ("exposures", "realityscan"): repeated(
        lambda k: f"a{k}.tif,{xyz(k).replace(' ', ',')},-89.7,-0.2,-0.01\n",
        "#name,x,y,alt,heading,pitch,roll\n",
    ),
    ("exposures", "dji-mrk"): repeated(_mrk),
    ("trajectory", "sbet"): repeated(_sbet),
    ("trajectory", "rtklib"): repeated(_rtklib, sound._RTKLIB[: sound._RTKLIB.index("2020/")]),
    ("accuracy", "smrmsg"): repeated(_smrmsg),
    ("events", "csv"): repeated(lambda k: f"a{k:06d},{k}.5,C\n", "image,time,camera\n"),
    ("events", "dji-mrk"): repeated(_mrk),
    ("control", "csv"): repeated(lambda k: f"A{k},{xyz(k).replace(' ', ',')}\n", "point,x,y,z\n"),
    ("control", "ign-app"): repeated(lambda k: f"A{k} 13 {xyz(k)}\n"),
    ("control", "patb"): up_to(
        12_000_000,
        repeated(lambda k: f"A{k} {' '.join(xyz(k).split()[:2])}\n", tail="-99\nA1 10.25\n-99\n"),
    ),
    ("control", "bingo"): repeated(lambda k: f"CONT {k} {xyz(k)}\n"),
    ("control", "inpho"): passage(texts.INPHO, "  c1 ", "0\n", _named("c1")),
    ("control", "isat"): repeated(
        lambda k: f" A{k} {xyz(k)} HV\n", "begin control_points\n", "end control_points\n"
    ),
    ("control", "metashape-markers"): passage(
        texts.MARKERS,
        '<marker id="0" label="g1"',
        "</marker>",
        lambda one, k: one.replace('"0"', f'"m{k}"').replace("g1", f"g{k}"),
    ),
    ("control", "blocks-exchange"): passage(
        sound._BLOCKS, "<ControlPoint>", "</ControlPoint>", _named("<Name>g1")
    ),
    ("control", "odm-gcp"): repeated(lambda k: f"{xyz(k // 9)} {xy(k)} {image(k)}.tif g{k // 9}\n", _ODM),
    ("control", "opf"): _opf(
        "p/input-control-points.json", '{"id": "G1"', '"is_checkpoint": true}', _named("G1")
    ),
    ("control", "micmac"): passage(small.GROUND_POINTS, "<OneAppuisDAF>", "</OneAppuisDAF>", _named("G 1")),
    ("camera", "csv"): _cameras,
    ("camera", "ossim"): repeated(lambda k: f"// {k}\n", sound._OSSIM),
    ("camera", "stac"): _stac,
    ("exposures", "stac"): _stac,
    ("control", "opensfm-gcp"): passage(sound._OPENSFM_GCP, '{"id": "g1"', "}]}", _named("g1"), ", "),
    ("image points", "opensfm-gcp"): passage(sound._OPENSFM_GCP, '{"id": "g1"', "}]}", _named("g1"), ", "),
    ("camera", "ign-xml"): passage(
        sound._IGN_XML, "<focal>", "</focal>", lambda one, k: one if k == 0 else f"<other>{k}</other>\n"
    ),
    ("camera", "inpho"): passage(
        texts.INPHO,
        "$CAMERA_DEFINITION",
        "$PHOTO\n",
        lambda one, k: (
            one.removesuffix("$PHOTO\n").replace("Xp", f"Xp{k}") if k else one.removesuffix("$PHOTO\n")
        ),
    ),
    ("camera", "isat"): passage(
        sound.SOUND["camera", "isat"],
        "begin",
        "end camera_parameters\n",
        lambda one, k: one.replace("C\n", f"C{k}\n"),
    ),
    ("camera", "metashape"): passage(
        sound._METASHAPE,
        "<sensor id",
        "</sensor>",
        lambda one, k: one.replace('"0"', f'"{k}"').replace('"S"', f'"S{k}"'),
    ),
    ("camera", "blocks-exchange"): passage(
        sound._BLOCKS, "<Photogroup>", "</Photogroup>", _named("<Name>UC")
    ),
    ("camera", "colmap"): _colmap_cameras,
    ("camera", "opensfm"): passage(sound._RECONSTRUCTION, '"c": {"projection', "}", _named('"c'), ", "),
    ("camera", "pix4d"): up_to(
        8_000_000,
        passage(
            sound.PIX4D_CAMERAS,
            "IMG 1",
            "0 0 -1\n",
            lambda one, k: one.replace("IMG 1", f"IMG {k}").replace("0.1 0 0", f"0.{k} 0 0"),
        ),
    ),
    ("camera", "pix4d-cam"): passage(
        sound.PIX4D_CAMERA_FILE,
        "camera_calibration_file",
        "0.00001 0\n",
        lambda one, k: one.replace("file 0", f"file {k}"),
    ),
    ("camera", "opf"): _opf(
        "p/input-cameras.json",
        '{"id": 3, "name"',
        "0.001]}}",
        lambda one, k: one.replace("3", str(3 + k), 1).replace('"S"', f'"S{k}"'),
    ),
    ("camera", "openmvg"): passage(
        sound._OPENMVG,
        '{"key": 0, "value": {"polymorphic_id": 2147483649',
        "}}}}",
        lambda one, k: one.replace('"key": 0', f'"key": {k}'),
        ", ",
    ),
    ("camera", "micmac"): passage(
        small.CALIBRATION, "<P2>0</P2>", "</P2>", lambda one, k: one if k == 0 else f"<other>{k}</other>\n"
    ),
    ("camera", "colmap-database"): _database_of_cameras,
}
#: Read as a whole: not larger than a document may be.
DOCUMENTS = {
    key
    for key in LARGE
    if key[1] in ("metashape", "metashape-markers", "blocks-exchange", "ign-xml", "openmvg")
    or key
    in {
        ("camera", "colmap"),
        ("camera", "opensfm"),
        ("exposures", "opensfm"),
        ("camera", "micmac"),
        ("control", "micmac"),
        ("control", "opensfm-gcp"),
        ("image points", "opensfm-gcp"),
    }
}
