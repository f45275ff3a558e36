"""A small sound file of every format, and damage that files come with."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable

from tasks.formats.register import (
    ACCURACY_FORMATS,
    CAMERA_FORMATS,
    CONTROL_FORMATS,
    EVENT_FORMATS,
    EXPOSURE_FORMATS,
    IMAGE_POINT_FORMATS,
    TRAJECTORY_FORMATS,
)
from tests.tasks.formats import packed_files as small
from tests.tasks.formats import test_classical_formats as texts

_EO = "image,camera,strip,x,y,z,omega,phi,kappa,time\nI1,C,S,500000.5,5300000.25,2000,0.1,-0.2,10,5.5\n"
_MATRIX = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"
_METASHAPE = f"""<document><chunk><sensors><sensor id="0" label="S" type="frame">
<resolution width="100" height="80"/>
<calibration class="adjusted"><f>200</f><cx>1.5</cx><k1>0.1</k1></calibration></sensor></sensors><components>
<component id="0"><transform><rotation>1 0 0 0 1 0 0 0 1</rotation><translation>4e6 6e5 4.9e6</translation>
<scale>1</scale></transform></component></components><cameras><camera id="0" sensor_id="0" component_id="0"
label="a"><transform>{_MATRIX}</transform></camera></cameras></chunk></document>"""
_APPLANIX = """\
 Mapping frame datum: WGS84  ; Mapping frame projection : TM;
 central meridian = 9.000000 deg;
 latitude of the grid origin = 0.000000 deg; grid scale factor = 0.999600:
 false easting = 500000.000000 m; false northing = 0.000000 m;
    First rotation is about the 'x' axis by the 'omega' angle.
    Second rotation is about the 'y' axis by the 'phi' angle.
    Third rotation is about the 'z' axis by the 'kappa' angle.
 POS/AV Computed Data at Camera Perspective Centre

 Record Format:

 ID, # EVENT, TIME (s), EASTING, NORTHING, ELLIPSOID HEIGHT, OMEGA, PHI, KAPPA, LAT, LONG

 (position in Meters, orientation in Degrees, lat, long in Deg)

17657707\t    3  576091.066218  470696.886 5155353.811 1997.734    2.43560    2.26026   89.58606 46.5 -87.3
"""
_RECONSTRUCTION = json.dumps(
    [
        {
            "cameras": {
                "c": {"projection_type": "perspective", "width": 100, "height": 80, "focal": 0.9, "k1": 0.1}
            },
            "shots": {"a": {"rotation": [0.1, 0.2, 0.3], "translation": [1.0, 2.0, 3.0], "camera": "c"}},
            "reference_lla": {"latitude": 48.0, "longitude": 11.0, "altitude": 500.0},
        }
    ]
)
_GCP = "EPSG:25832\n500123.412 5300456.789 412.334 4012.6 3001.2 a.tif 2001\n1 2 NaN 3 4 b.tif\n"
_COLMAP = (
    struct.pack("<QI7dI", 1, 1, 1, 0, 0, 0, 1, 2, 3, 1) + b"a.tif\0" + struct.pack("<QddQ", 1, 1.5, 2.5, 7)
)
_BUNDLE = "# Bundle file v0.3\n1 1\n500 0 0\n1 0 0\n0 1 0\n0 0 1\n1 2 3\n1 2 3\n255 0 0\n1 0 7 1.5 -2.5\n"
_BLOCKS = texts.BLOCKS.format(rotation=texts.ANGLES, axes="XRightYUp", srs="EPSG:32632")
_BAL = "1 1 1\n0 0 1.5 -2.5\n0.1\n0.2\n0.3\n1\n2\n3\n500\n0\n0\n1\n2\n3\n"
_DATABASE = small.colmap_database()
_VIEW = {"local_path": "", "filename": "a.tif", "id_view": 0, "id_intrinsic": 0, "id_pose": 0}
_LENS = {
    "width": 100,
    "height": 80,
    "focal_length": 200.0,
    "principal_point": [50, 41],
    "disto_k3": [0.1, 0, 0],
}
_OPENMVG = json.dumps(
    {
        "sfm_data_version": "0.3",
        "views": [
            {"key": 0, "value": {"polymorphic_id": 1073741824, "ptr_wrapper": {"id": 1, "data": _VIEW}}}
        ],
        "intrinsics": [
            {
                "key": 0,
                "value": {
                    "polymorphic_id": 2147483649,
                    "polymorphic_name": "pinhole_radial_k3",
                    "ptr_wrapper": {"id": 2, "data": _LENS},
                },
            }
        ],
        "extrinsics": [
            {"key": 0, "value": {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "center": [1, 2, 3]}}
        ],
        "structure": [
            {
                "key": 7,
                "value": {
                    "X": [1, 2, 3],
                    "observations": [{"key": 0, "value": {"id_feat": 5, "x": [1.5, 2]}}],
                },
            }
        ],
        "control_points": [],
    }
)
_OPK = "# Cameras (1)\na b\t1\t2\t3\t0\t0\t0\t1\t0\t0\t0\t1\t0\t0\t0\t1\n"
_IGN_XML = """<sensor><usefull-frame><rect><w>100</w><h>80</h></rect></usefull-frame>
<pixel_size>5e-6</pixel_size>
<focal><pt3d><x>50</x><y>40</y><z>20000</z></pt3d></focal></sensor>"""

_SBET = b"".join(
    struct.pack(
        "<17d", 0.005 * k, 0.85, 0.16, 2e3, 60, -1, 0.1, 0.01, 0.02, 1.5, 0.3, *(0,) * 3, *(0.01,) * 3
    )
    for k in range(1, 5)
)
_SMRMSG = b"".join(struct.pack("<10d", k, *(0.02,) * 3, *(0.005,) * 3, 0.2, 0.2, 0.5) for k in range(3))
_RTKLIB = """% program   : RTKPOST
%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  age(s)
2020/12/24 21:28:42.000   40.097025378 -105.147247371  1578.8456   2  11   1.4193   1.3913   2.9108   0.00
2020/12/24 21:28:43.000   40.097025245 -105.147247922  1578.8200   1  11   0.0348   0.0174   0.1384   0.00
"""
_MRK = (
    "1\t400373.488877\t[2264]\t   -40,N\t     0,E\t    86,V\t44.42824637,Lat\t1.26196331,Lon\t359.494,Ellh\t"
    "0.028, 0.031, 0.055\t50,Q\n"
)

PIX4D_CAMERAS = """fileName imageWidth imageHeight
camera matrix K [3x3]
radial distortion [3x1]
tangential distortion [2x1]
camera position t [3x1]
camera rotation R [3x3]
camera model m = K [R|-Rt] X

IMG 1.JPG 100 80
200 0 51.5
0 200 39
0 0 1
0.1 0 0
0 0.001
1 2 3
1 0 0
0 -1 0
0 0 -1
"""
# The camera of PIX4D_CAMERAS, with a focal length of 10 mm.
PIX4D_CAMERA_FILE = """camera_calibration_file 0
#Focal Length (mm) assuming a sensor width of 5.0x4.0mm
#Image size 100x80 pixel
FOCAL 10.0

#Principal Point Offset xpoff ypoff in mm (Inpho)
XPOFF 0.075
YPOFF 0.05
#Principal Point Offset xpoff ypoff in mm
XPOFF -0.075
YPOFF 0.05
#Principal Point Offset xpoff ypoff in pixel
XPOFF -1.5
YPOFF 1.0

#How many fiducial pairs (max 8):
NUM_FIDS 4

#Symmetrical Lens Distortion Odd-order Poly Coeffs:K0,K1,K2,K3
SYM_DIST 0 0.0001 0 0

#Decentering Lens Coeffs p1,p2,p3
DEC_DIST 0 0.00001 0
"""
_OSSIM = (
    "// a camera\nsensor: C\nfocal_length: 60.5\nprincipal_point: -0.2 0.1\nimage_size: 100.0 80.0\n"
    "pixel_size: 0.009\n"
    + "".join(f"d{k}: {k + 1} {-0.02 * (k + 1) ** 3:.3f}\n" for k in range(6))
    + "distortion_units: microns\n"
)
_STAC = json.dumps(
    {
        "type": "Feature",
        "stac_version": "1.0.0",
        "id": "a",
        "properties": {
            "pers:crs": 25832,
            "pers:perspective_center": [500000.5, 5300000.25, 900.0],
            "pers:omega": 0.1,
            "pers:phi": -0.2,
            "pers:kappa": 10.0,
            "pers:interior_orientation": {
                "camera_id": "C",
                "sensor_array_dimensions": [100, 80],
                "pixel_spacing": [0.005, 0.005],
                "focal_length": 80.0,
                "principal_point_offset": [0.1, 0],
            },
        },
        "assets": {"image": {"href": "x/a.tif", "roles": ["data"]}},
    }
)
_OPENSFM_GCP = json.dumps(
    {
        "points": [
            {
                "id": "g1",
                "position": {"latitude": 48.0, "longitude": 11.0, "altitude": 500.5},
                "observations": [{"shot_id": "a.jpg", "projection": [0.1, -0.2]}],
            }
        ]
    }
)
#: (what is read, format) → content.
SOUND: dict[tuple[str, str], str | bytes] = {
    ("image points", "csv"): "image,point,x,y\nI1,P1,1.5,2.5\n",
    ("image points", "ign-mes"): "P1 I1 1.5 2.5\n",
    ("image points", "patb"): "1001 120000.0\n5 -34210.4 12988.7\n-99\n",
    ("image points", "bingo"): "IMG CAM # x\nT1 -41.2 22.0\n-99\n",
    ("image points", "pix4d"): "IMG.JPG\n5 100.5 200.5 1.2\n-99\n",
    ("image points", "inpho"): texts.INPHO,
    ("image points", "metashape-markers"): texts.MARKERS,
    ("image points", "blocks-exchange"): _BLOCKS,
    ("image points", "colmap"): _COLMAP,
    ("image points", "opensfm"): "OPENSFM_TRACKS_VERSION_v2\na\t1\t2\t0.1\t-0.2\t0.001\t1\t2\t3\t-1\t-1\n",
    ("image points", "odm-gcp"): _GCP,
    ("image points", "bundler"): _BUNDLE,
    ("image points", "opf"): small.packed(small.OPF),
    ("image points", "openmvg"): _OPENMVG,
    ("image points", "micmac"): small.packed(small.MICMAC_POINTS),
    ("image points", "bal"): _BAL,
    ("image points", "colmap-database"): _DATABASE,
    ("exposures", "csv"): _EO,
    ("exposures", "ign-opk"): "I1 1 2 3 0.1 0.2 0.3 C\n",
    ("exposures", "applanix"): _APPLANIX,
    ("exposures", "patb"): texts.PATB,
    ("exposures", "bingo"): "ORIA 17 500.5 600.5 1000.25 1.5 2.5 100.0 CAM1\n",
    ("exposures", "inpho"): texts.INPHO,
    ("exposures", "isat"): texts.ISAT,
    ("exposures", "metashape-opk"): _OPK,
    ("exposures", "metashape"): _METASHAPE,
    (
        "exposures",
        "pix4d",
    ): "imageName X Y Z Omega Phi Kappa\nIMG 1.JPG 500123.41 5300456.7 2430.1 0.1 -0.2 89.7\n",
    ("exposures", "blocks-exchange"): _BLOCKS,
    ("exposures", "colmap"): "1 1 0 0 0 1 2 3 1 a.tif\n1.5 2.5 7 3 4 -1\n",
    ("exposures", "opensfm"): _RECONSTRUCTION,
    ("exposures", "odm-geo"): "WGS84\na.jpg 11.5 48.0 600\n",
    ("exposures", "bundler"): _BUNDLE,
    ("exposures", "opf"): small.packed(small.OPF),
    ("exposures", "openmvg"): _OPENMVG,
    ("exposures", "micmac"): small.packed(small.MICMAC_ORIENTATIONS),
    ("exposures", "bal"): _BAL,
    ("exposures", "colmap-database"): _DATABASE,
    ("exposures", "realityscan"): "#name,x,y,alt,heading,pitch,roll\na.tif,1,2,3,-89.7,-0.2,-0.01\n",
    ("exposures", "dji-mrk"): _MRK,
    ("trajectory", "sbet"): _SBET,
    ("trajectory", "rtklib"): _RTKLIB,
    ("accuracy", "smrmsg"): _SMRMSG,
    ("events", "csv"): "image,time,camera\na,1.5,C\n",
    ("events", "dji-mrk"): _MRK,
    ("control", "csv"): "point,x,y,z\nA,1,2,3\n",
    ("control", "ign-app"): "A 13 1 2 3\n",
    ("control", "patb"): "A 1.5 2.5\n-99\nA 10.25\n-99\n",
    ("control", "bingo"): "CONT 2001 500123.412 5300456.789 412.334\n",
    ("control", "inpho"): texts.INPHO,
    ("control", "isat"): "begin control_points\n A 1 2 3 HV\nend control_points\n",
    ("control", "metashape-markers"): texts.MARKERS,
    ("control", "blocks-exchange"): _BLOCKS,
    ("control", "odm-gcp"): _GCP,
    ("control", "opf"): small.packed(small.OPF),
    ("control", "micmac"): small.GROUND_POINTS,
    ("camera", "csv"): "camera,columns,rows,pixel_um,focal_length_mm,x0_mm,y0_mm\nC,100,80,5,60.5,0.1,-0.2\n",
    ("camera", "ossim"): _OSSIM,
    ("camera", "stac"): _STAC,
    ("exposures", "stac"): _STAC,
    ("control", "opensfm-gcp"): _OPENSFM_GCP,
    ("image points", "opensfm-gcp"): _OPENSFM_GCP,
    ("camera", "ign-xml"): _IGN_XML,
    ("camera", "inpho"): texts.INPHO,
    ("camera", "isat"): (
        "begin camera_parameters C\n focal_length: 100\n ppac: 0 0\n pixel_size: 5\n"
        " image_size_in_pixels: 10 8\nend camera_parameters\n"
    ),
    ("camera", "metashape"): _METASHAPE,
    ("camera", "blocks-exchange"): _BLOCKS,
    ("camera", "colmap"): "1 OPENCV 100 80 200 201 50 40 0.1 0 0.001 0\n",
    ("camera", "opensfm"): _RECONSTRUCTION,
    ("camera", "pix4d"): PIX4D_CAMERAS,
    ("camera", "pix4d-cam"): PIX4D_CAMERA_FILE,
    ("camera", "opf"): small.packed(small.OPF),
    ("camera", "openmvg"): _OPENMVG,
    ("camera", "micmac"): small.CALIBRATION,
    ("camera", "colmap-database"): _DATABASE,
}
#: What is read → its readers by format; all take one path.
READERS: dict[str, dict[str, Callable[..., object]]] = {
    "image points": dict(IMAGE_POINT_FORMATS),
    "exposures": {
        name: lambda path, reader=reader: reader(path, "omega-phi-kappa")
        for name, reader in EXPOSURE_FORMATS.items()
    },
    "control": dict(CONTROL_FORMATS),
    "trajectory": dict(TRAJECTORY_FORMATS),
    "accuracy": dict(ACCURACY_FORMATS),
    "events": {
        name: lambda path, reader=reader: reader(path, "week") for name, reader in EVENT_FORMATS.items()
    },
    "camera": dict(CAMERA_FORMATS),
}


def content_of(key: tuple[str, str]) -> bytes:
    """The sound file as bytes."""
    content = SOUND[key]
    return content if isinstance(content, bytes) else content.encode()
