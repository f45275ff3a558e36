"""All formats in which results are handed over; a further one is a file here and a row."""

from __future__ import annotations

from collections.abc import Mapping

from adjust.handover.refit import Freed
from tasks.handover.delivery import DeliveryFormat
from tasks.handover.formats.blocks_exchange import write_blocks_exchange
from tasks.handover.formats.colmap import write_colmap
from tasks.handover.formats.eo_csv import write_eo_csv
from tasks.handover.formats.esri import write_esri
from tasks.handover.formats.geopackage import write_geopackage
from tasks.handover.formats.inpho import write_inpho
from tasks.handover.formats.isat import write_isat
from tasks.handover.formats.metashape import write_metashape
from tasks.handover.formats.nerfstudio import write_nerfstudio
from tasks.handover.formats.opensfm import write_opensfm
from tasks.handover.formats.opf import write_opf
from tasks.handover.formats.orbit import write_orbit
from tasks.handover.formats.patb import write_patb
from tasks.handover.formats.rpc import write_rpc
from tasks.handover.formats.stac import write_stac
from tasks.handover.receiver import World

_CAMERA_TOO, _POSE_ONLY = Freed(focal_length=True), Freed()
_CARTESIAN: tuple[World, ...] = ("local", "map-cartesian", "map-cartesian-curved")
_LOCAL: tuple[World, ...] = ("local",)
_LENS = ("k1", "k2", "k3", "p1", "p2")
_ANY: tuple[World, ...] = ("local", "map", "map-cartesian", "map-cartesian-curved")

REGISTER: Mapping[str, DeliveryFormat] = {
    item.name: item
    for item in (
        DeliveryFormat(
            "eo-csv",
            "table with header: image, camera, X, Y, Z, angles of any system, standard deviations",
            "map",
            _ANY,
            _POSE_ONLY,
            write_eo_csv,
            seen=True,
        ),
        DeliveryFormat(
            "patb",
            "PATB .ori: positions and rotation matrices in fixed columns",
            "map-cartesian",
            _ANY,
            _POSE_ONLY,
            write_patb,
            seen=False,
        ),
        DeliveryFormat(
            "esri",
            "Frames and Cameras tables of ArcGIS",
            "map-cartesian",
            _ANY,
            _CAMERA_TOO,
            write_esri,
            seen=False,
        ),
        DeliveryFormat(
            "orbit",
            "Orbit 3DM: one line an image, for undistorted images",
            "map-cartesian",
            _ANY,
            _POSE_ONLY,
            write_orbit,
            seen=False,
        ),
        DeliveryFormat(
            "inpho",
            "Inpho project (.prj): cameras, photos, orientations",
            "map-cartesian-curved",
            _CARTESIAN,
            _CAMERA_TOO,
            write_inpho,
            seen=False,
        ),
        DeliveryFormat(
            "isat",
            "ImageStation files photo and camera",
            "map-cartesian-curved",
            _CARTESIAN,
            _CAMERA_TOO,
            write_isat,
            seen=False,
        ),
        DeliveryFormat(
            "metashape",
            "Metashape OPK text",
            "map",
            ("map", "local"),
            _POSE_ONLY,
            write_metashape,
            seen=False,
        ),
        DeliveryFormat(
            "rpc",
            "rational polynomials, one _RPC.TXT an image: GDAL, QGIS, ArcGIS, ERDAS, Catalyst, OTB, SNAP",
            "rpc",
            ("rpc",),
            _POSE_ONLY,
            write_rpc,
            seen=True,
        ),
        DeliveryFormat(
            "colmap",
            "COLMAP text model: cameras, images, points",
            "local",
            _LOCAL,
            _POSE_ONLY,
            write_colmap,
            seen=True,
            lens=(*_LENS, "b1"),
            points=True,
        ),
        DeliveryFormat(
            "geopackage",
            "GeoPackage for QGIS and every GIS: cameras, footprints, points, residual vectors",
            "map",
            ("map",),
            _POSE_ONLY,
            write_geopackage,
            seen=True,
            points=True,
        ),
        DeliveryFormat(
            "opf",
            "OPF project (Pix4D): cameras, control and check points with their marks",
            "local",
            _LOCAL,
            _POSE_ONLY,
            write_opf,
            seen=True,
            lens=_LENS,
            points=True,
        ),
        DeliveryFormat(
            "opensfm",
            "OpenSfM and ODM: reconstruction.json and tracks.csv",
            "local",
            _LOCAL,
            _POSE_ONLY,
            write_opensfm,
            seen=False,
            lens=(*_LENS, "b1"),
            points=True,
        ),
        DeliveryFormat(
            "nerfstudio",
            "nerfstudio and 3D Gaussian splatting: transforms.json",
            "local",
            _LOCAL,
            _POSE_ONLY,
            write_nerfstudio,
            seen=False,
            lens=(*_LENS, "b1"),
        ),
        DeliveryFormat(
            "blocks-exchange",
            "BlocksExchange XML: iTwin Capture, ContextCapture, Metashape, RealityScan",
            "local",
            _LOCAL,
            _POSE_ONLY,
            write_blocks_exchange,
            seen=False,
            lens=_LENS,
            points=True,
        ),
        DeliveryFormat(
            "stac",
            "STAC items with perspective-imagery: orientation and footprint of every image",
            "map",
            ("map",),
            _POSE_ONLY,
            write_stac,
            seen=True,
        ),
    )
}
