"""Small sound folders and databases of formats that are delivered as one binary file."""

from __future__ import annotations

import io
import json
import sqlite3
import struct
import zipfile
from collections.abc import Mapping
from contextlib import closing


def packed(files: Mapping[str, str | bytes]) -> bytes:
    """A zip file of these."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name), content)
    return stream.getvalue()


def opf_file(kind: str, content: dict[str, object]) -> str:
    return json.dumps({"format": f"application/opf-{kind}+json", "version": "1.0", **content})


def _item(kind: str, files: tuple[str, ...]) -> dict[str, object]:
    resources = [{"uri": f"{file}.json", "format": f"application/opf-{file}+json"} for file in files]
    return {"id": "1", "type": kind, "resources": resources, "sources": []}


_LENS = {
    "type": "perspective", "principal_point_px": [51.5, 39.0], "focal_length_px": 200.0,
    "radial_distortion": [0.1, 0, 0], "tangential_distortion": [0, 0.001],
}  # fmt: skip
_CRS = {"definition": "EPSG:25832"}
OPF = {
    "p/project.opf": json.dumps(
        {
            "format": "application/opf-project+json", "version": "1.0",
            "items": [
                _item("camera_list", ("camera-list",)),
                _item("input_cameras", ("input-cameras",)),
                _item("scene_reference_frame", ("scene-reference-frame",)),
                _item("input_control_points", ("input-control-points",)),
                _item("calibration", ("calibrated-cameras",)),
            ],
        }
    ),
    "p/camera-list.json": opf_file("camera-list", {"cameras": [{"id": 7, "uri": "file:///c:/a/IMG 1.tif"}]}),
    "p/input-cameras.json": opf_file(
        "input-cameras",
        {
            "sensors": [{"id": 3, "name": "S", "image_size_px": [100, 80], "internals": _LENS}],
            "captures": [],
        },
    ),
    "p/scene-reference-frame.json": opf_file(
        "scene-reference-frame",
        {"crs": _CRS, "base_to_canonical": {"scale": [1, 1, 1], "shift": [-5e5, -53e5, 0], "swap_xy": False}},
    ),
    "p/calibrated-cameras.json": opf_file(
        "calibrated-cameras",
        {
            "cameras": [
                {
                    "id": 7,
                    "sensor_id": 3,
                    "position": [10.5, 20.25, 900],
                    "orientation_deg": [1.0, -2.0, 30.0],
                }
            ],
            "sensors": [{"id": 3, "internals": {**_LENS, "focal_length_px": 201.0}}],
        },
    ),
    "p/input-control-points.json": opf_file(
        "input-control-points",
        {
            "gcps": [
                {
                    "id": "G1",
                    "geolocation": {"crs": _CRS, "coordinates": [500000, 5300000, 12], "sigmas": [1, 1, 2]},
                    "marks": [{"camera_id": 7, "position_px": [1.5, 2.5], "accuracy": 1}],
                    "is_checkpoint": True,
                }
            ],
            "mtps": [{"id": "M1", "marks": [{"camera_id": 7, "position_px": [3, 4], "accuracy": 1}]}],
        },
    ),
}  # fmt: skip

ORIENTATION = """<?xml version="1.0" ?>
<ExportAPERO><OrientationConique><Externe><AltiSol>0</AltiSol><Profondeur>9</Profondeur>
<Centre>10.5 20.25 900</Centre><ParamRotation><CodageMatr>
<L1>0.969777798578 -0.210783330506 0.122887790141</L1><L2>{second}</L2><L3>{third}</L3>
</CodageMatr></ParamRotation></Externe></OrientationConique></ExportAPERO>"""
CALIBRATION = """<ExportAPERO><CalibrationInternConique><KnownConv>eConvApero_DistM2C</KnownConv>
<PP>51.5 39</PP><F>200</F><SzIm>100 80</SzIm><CalibDistortion><ModPhgrStd><RadialePart>
<CDist>50 40</CDist><CoeffDist>1e-5</CoeffDist><CoeffDist>2e-13</CoeffDist></RadialePart>
<P1>1e-6</P1><P2>0</P2></ModPhgrStd></CalibDistortion></CalibrationInternConique></ExportAPERO>"""
GROUND_POINTS = """<DicoAppuisFlottant><OneAppuisDAF><Pt>1.5 2.5 3.5</Pt><NamePt>G 1</NamePt>
<Incertitude>0.02 0.02 -1</Incertitude></OneAppuisDAF></DicoAppuisFlottant>"""
MICMAC_ORIENTATIONS = {
    "Ori-A/Orientation-a b.tif.xml": ORIENTATION.format(second="0 1 0", third="0 0 1").replace(
        "0.969777798578 -0.210783330506 0.122887790141", "1 0 0"
    ),
    "Ori-A/AutoCal1.xml": CALIBRATION,
}
MICMAC_POINTS = {
    "Homol/Pastisa.tif/b.tif.txt": "1.5 2.5 3.5 4.5 1.0\n7 8 9 10\n",
    "Homol/Pastisb.tif/a.tif.txt": "3.5 4.5 1.5 2.5\n",
    "Homol/Pastisb.tif/c.tif.txt": "3.5 4.5 5.5 6.5\n",
}
PACKED = {
    ("image points", "opf"): OPF,
    ("exposures", "opf"): OPF,
    ("control", "opf"): OPF,
    ("camera", "opf"): OPF,
    ("exposures", "micmac"): MICMAC_ORIENTATIONS,
    ("camera", "micmac"): MICMAC_ORIENTATIONS,
    ("image points", "micmac"): MICMAC_POINTS,
}


def colmap_database(system: int = 0) -> bytes:
    """A database of the current generation: two images, three matches, one prior."""
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.executescript(
            """
            CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY, model INTEGER, width INTEGER, height INTEGER,
              params BLOB, prior_focal_length INTEGER);
            CREATE TABLE images (image_id INTEGER PRIMARY KEY, name TEXT, camera_id INTEGER);
            CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);
            CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER,
              data BLOB);
            CREATE TABLE pose_priors (pose_prior_id INTEGER PRIMARY KEY, corr_data_id INTEGER,
              corr_sensor_id INTEGER, corr_sensor_type INTEGER, position BLOB, position_covariance BLOB,
              gravity BLOB, coordinate_system INTEGER);
            INSERT INTO images VALUES (1, 'a.tif', 1), (2, 'b.tif', 1), (3, 'c.tif', 1);
            """
        )
        lens = struct.pack("<8d", 200, 201, 50, 40, 0.1, 0, 0.001, 0)
        connection.execute("INSERT INTO cameras VALUES (1, 4, 100, 80, ?, 1)", (lens,))
        for image in (1, 2, 3):
            # Six columns: affine features; two of them are x and y.
            points = [[10 * image + k, k + 0.5, 1, 0, 0, 1] for k in range(3)]
            data = struct.pack("<18f", *[value for point in points for value in point])
            connection.execute("INSERT INTO keypoints VALUES (?, 3, 6, ?)", (image, data))
        for first, second, matches in ((1, 2, (0, 0, 1, 1)), (2, 3, (1, 2)), (1, 3, ())):
            connection.execute(
                "INSERT INTO two_view_geometries VALUES (?, ?, 2, ?)",
                (2147483647 * first + second, len(matches) // 2, struct.pack(f"<{len(matches)}I", *matches)),
            )
        covariance = struct.pack("<9d", 0.0004, 0, 0, 0, 0.0009, 0, 0, 0, 0.0025)
        connection.execute(
            "INSERT INTO pose_priors VALUES (1, 2, 1, 0, ?, ?, NULL, ?)",
            (struct.pack("<3d", 48.5, 9.25, 900.0), covariance, system),
        )
        connection.commit()
        return connection.serialize()
