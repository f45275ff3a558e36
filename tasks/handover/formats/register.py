"""All formats in which results are exported; to add one, add a file here and a row.

Formats of whole blocks are in `EXCHANGE`, those of results alone in `DELIVERIES`.
"""

from __future__ import annotations

from collections.abc import Mapping

from adjust.handover.refit import Freed
from tasks.handover.delivery import DeliveryFormat
from tasks.handover.formats.catalyst import write_catalyst
from tasks.handover.formats.eo_csv import write_eo_csv
from tasks.handover.formats.esri import write_esri
from tasks.handover.formats.exchange import EXCHANGE, LENS, LENS_OF_TWO_FOCAL_LENGTHS
from tasks.handover.formats.geopackage import write_geopackage
from tasks.handover.formats.grid_text import write_distortion_grids
from tasks.handover.formats.inpho import write_inpho
from tasks.handover.formats.isat import write_isat
from tasks.handover.formats.metashape import write_metashape
from tasks.handover.formats.metashape_xml import write_metashape_xml
from tasks.handover.formats.nerfstudio import write_nerfstudio
from tasks.handover.formats.on_earth import write_geojson, write_kmz
from tasks.handover.formats.orbit import write_orbit
from tasks.handover.formats.orthority import write_orthority
from tasks.handover.formats.realityscan import write_realityscan
from tasks.handover.formats.rpc import write_rpc
from tasks.handover.formats.stac import write_stac
from tasks.handover.formats.sure import write_sure

_CAMERA_TOO = Freed(focal_length=True)
_ANGLES = "1e-4 m, 1e-7°"
_MATRIX = "1e-4 m, 1e-12 of a rotation"

DELIVERIES: Mapping[str, DeliveryFormat] = {
    item.name: item
    for item in (
        DeliveryFormat("eo-csv", write_eo_csv, _ANGLES, seen=True),
        DeliveryFormat("esri", write_esri, _ANGLES, _CAMERA_TOO),
        DeliveryFormat("sure", write_sure, "15 digits"),
        DeliveryFormat("orbit", write_orbit, _ANGLES),
        DeliveryFormat("inpho", write_inpho, _MATRIX, _CAMERA_TOO),
        DeliveryFormat("isat", write_isat, f"{_ANGLES}; grids 1e-3 µm", _CAMERA_TOO, grid=True),
        DeliveryFormat("metashape", write_metashape, f"{_ANGLES}, matrix 1e-12"),
        DeliveryFormat(
            "metashape-xml",
            write_metashape_xml,
            "15 digits; image points 1e-4 px",
            lens=LENS_OF_TWO_FOCAL_LENGTHS,
            points=True,
            on_wgs84=True,
            rigs="with-reference",
        ),
        DeliveryFormat("rpc", write_rpc, "15 digits of every coefficient", seen=True),
        DeliveryFormat("geopackage", write_geopackage, "17 digits", seen=True, points=True, surveyed="all"),
        DeliveryFormat("nerfstudio", write_nerfstudio, "17 digits", lens=LENS_OF_TWO_FOCAL_LENGTHS),
        DeliveryFormat("stac", write_stac, _MATRIX, seen=True),
        DeliveryFormat(
            "realityscan",
            write_realityscan,
            "1e-4 m, 1e-7°; XMP 15 digits of a rotation",
            lens=LENS,
        ),
        DeliveryFormat(
            "orthority",
            write_orthority,
            "17 digits",
            Freed(focal_length=True, radial=True),
            lens=LENS,
        ),
        DeliveryFormat("catalyst", write_catalyst, f"{_ANGLES}; grids 1e-3 µm", grid=True),
        DeliveryFormat(
            "distortion-grid",
            write_distortion_grids,
            "1e-6 mm; shifts 1e-4 µm",
            grid=True,
            oriented=False,
        ),
        DeliveryFormat("geojson", write_geojson, "1e-9°, 1e-4 m", points=True),
        DeliveryFormat("kmz", write_kmz, "1e-8°, 1e-3 m", points=True),
    )
}

REGISTER: Mapping[str, DeliveryFormat] = {**EXCHANGE, **DELIVERIES}
