"""The formats that can be read: a new one is a new file and one line here.

Other packages add formats by entry points, see ``adjust.extensions``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias

from adjust.extensions import Extended, trouble_of_function
from tasks.formats.applanix import read_applanix
from tasks.formats.bal import read_bal_exposures, read_bal_image_points
from tasks.formats.bingo import read_bingo_control, read_bingo_orientations
from tasks.formats.blocks_exchange import (
    read_blocks_cameras,
    read_blocks_control,
    read_blocks_exposures,
    read_blocks_image_points,
)
from tasks.formats.bundler import read_bundler_exposures, read_bundler_image_points
from tasks.formats.colmap import read_colmap_cameras, read_colmap_exposures, read_colmap_image_points
from tasks.formats.colmap_database import (
    read_colmap_database_cameras,
    read_colmap_database_exposures,
    read_colmap_database_image_points,
)
from tasks.formats.dji import read_mrk_events, read_mrk_exposures
from tasks.formats.ign_camera import read_ign_cameras
from tasks.formats.ign_text import read_ign_app, read_ign_mes, read_ign_opk
from tasks.formats.inpho import (
    read_inpho_cameras,
    read_inpho_control,
    read_inpho_exposures,
    read_inpho_image_points,
)
from tasks.formats.isat import read_isat_cameras, read_isat_control, read_isat_exposures
from tasks.formats.metashape import (
    read_metashape_cameras,
    read_metashape_exposures,
    read_metashape_markers,
    read_metashape_measurements,
    read_metashape_opk,
)
from tasks.formats.micmac import (
    read_micmac_cameras,
    read_micmac_control,
    read_micmac_exposures,
    read_micmac_image_points,
)
from tasks.formats.native_csv import (
    read_csv_cameras,
    read_csv_control,
    read_csv_distances,
    read_csv_events,
    read_csv_exposures,
    read_csv_image_points,
)
from tasks.formats.openmvg import (
    read_openmvg_cameras,
    read_openmvg_exposures,
    read_openmvg_image_points,
)
from tasks.formats.opensfm import (
    read_odm_control,
    read_odm_geo,
    read_odm_measurements,
    read_opensfm_cameras,
    read_opensfm_exposures,
    read_opensfm_tracks,
)
from tasks.formats.opensfm_control import read_opensfm_control, read_opensfm_measurements
from tasks.formats.opf import (
    read_opf_cameras,
    read_opf_control,
    read_opf_distances,
    read_opf_exposures,
    read_opf_image_points,
)
from tasks.formats.ossim import read_ossim_camera
from tasks.formats.patb import read_patb_control, read_patb_orientations
from tasks.formats.photo_lists import read_photo_lists
from tasks.formats.pix4d import read_pix4d_cameras, read_pix4d_exposures
from tasks.formats.pix4d_camera_file import read_pix4d_camera_file
from tasks.formats.realityscan import read_realityscan_exposures
from tasks.formats.records import (
    AngleOrder,
    CameraRecord,
    ControlRecords,
    DistanceRecords,
    ExposureRecords,
    ImagePointRecords,
    PixelCamera,
)
from tasks.formats.rtklib import read_rtklib
from tasks.formats.sbet import read_sbet, read_smrmsg
from tasks.formats.stac import read_stac_cameras, read_stac_exposures
from tasks.formats.table_layout import TableLayout
from tasks.formats.trajectory_records import AccuracyRecords, Count, EventRecords, TrajectoryRecords

ImagePointReader: TypeAlias = Callable[[Path], ImagePointRecords]
ExposureReader: TypeAlias = Callable[[Path, AngleOrder], ExposureRecords]
ControlReader: TypeAlias = Callable[[Path], ControlRecords]
DistanceReader: TypeAlias = Callable[[Path], DistanceRecords]
TrajectoryReader: TypeAlias = Callable[[Path], TrajectoryRecords]
AccuracyReader: TypeAlias = Callable[[Path], AccuracyRecords]
EventReader: TypeAlias = Callable[[Path, Count], EventRecords]
CameraReader: TypeAlias = Callable[[Path], Mapping[str, CameraRecord | PixelCamera]]

#: The format whose layout a project file may declare.
TABLE = "csv"
_IMAGE_POINT_FORMATS: dict[str, ImagePointReader] = {
    TABLE: read_csv_image_points,
    "ign-mes": read_ign_mes,
    "patb": read_photo_lists,
    "bingo": read_photo_lists,
    "inpho": read_inpho_image_points,
    "metashape-markers": read_metashape_measurements,
    "pix4d": read_photo_lists,
    "blocks-exchange": read_blocks_image_points,
    "colmap": read_colmap_image_points,
    "opensfm": read_opensfm_tracks,
    "odm-gcp": read_odm_measurements,
    "opensfm-gcp": read_opensfm_measurements,
    "bundler": read_bundler_image_points,
    "opf": read_opf_image_points,
    "openmvg": read_openmvg_image_points,
    "micmac": read_micmac_image_points,
    "bal": read_bal_image_points,
    "colmap-database": read_colmap_database_image_points,
}
IMAGE_POINT_FORMATS = Extended("image_points", _IMAGE_POINT_FORMATS, trouble_of_function)
_EXPOSURE_FORMATS: dict[str, ExposureReader] = {
    TABLE: read_csv_exposures,
    "ign-opk": read_ign_opk,
    "applanix": read_applanix,
    "patb": read_patb_orientations,
    "bingo": read_bingo_orientations,
    "inpho": read_inpho_exposures,
    "isat": read_isat_exposures,
    "metashape-opk": read_metashape_opk,
    "metashape": read_metashape_exposures,
    "pix4d": read_pix4d_exposures,
    "blocks-exchange": read_blocks_exposures,
    "colmap": read_colmap_exposures,
    "opensfm": read_opensfm_exposures,
    "odm-geo": read_odm_geo,
    "bundler": read_bundler_exposures,
    "realityscan": read_realityscan_exposures,
    "opf": read_opf_exposures,
    "openmvg": read_openmvg_exposures,
    "micmac": read_micmac_exposures,
    "bal": read_bal_exposures,
    "colmap-database": read_colmap_database_exposures,
    "dji-mrk": read_mrk_exposures,
    "stac": read_stac_exposures,
}
EXPOSURE_FORMATS = Extended("exposures", _EXPOSURE_FORMATS, trouble_of_function)
TRAJECTORY_FORMATS: dict[str, TrajectoryReader] = {"sbet": read_sbet, "rtklib": read_rtklib}
#: Exposures, and trajectories that they are taken from.
EXPOSURE_SOURCES: Extended[ExposureReader | TrajectoryReader] = Extended(
    "exposures", {**_EXPOSURE_FORMATS, **TRAJECTORY_FORMATS}, trouble_of_function
)
ACCURACY_FORMATS: dict[str, AccuracyReader] = {"smrmsg": read_smrmsg}
EVENT_FORMATS: dict[str, EventReader] = {
    TABLE: read_csv_events,
    "dji-mrk": lambda path, _count: read_mrk_events(path),
}
_CONTROL_FORMATS: dict[str, ControlReader] = {
    TABLE: read_csv_control,
    "ign-app": read_ign_app,
    "patb": read_patb_control,
    "bingo": read_bingo_control,
    "inpho": read_inpho_control,
    "isat": read_isat_control,
    "metashape-markers": read_metashape_markers,
    "blocks-exchange": read_blocks_control,
    "odm-gcp": read_odm_control,
    "opensfm-gcp": read_opensfm_control,
    "opf": read_opf_control,
    "micmac": read_micmac_control,
}
CONTROL_FORMATS = Extended("control_points", _CONTROL_FORMATS, trouble_of_function)
_DISTANCE_FORMATS: dict[str, DistanceReader] = {TABLE: read_csv_distances, "opf": read_opf_distances}
DISTANCE_FORMATS = Extended("distances", _DISTANCE_FORMATS, trouble_of_function)
_CAMERA_FORMATS: dict[str, CameraReader] = {
    TABLE: read_csv_cameras,
    "ign-xml": read_ign_cameras,
    "inpho": read_inpho_cameras,
    "isat": read_isat_cameras,
    "metashape": read_metashape_cameras,
    "blocks-exchange": read_blocks_cameras,
    "colmap": read_colmap_cameras,
    "opensfm": read_opensfm_cameras,
    "pix4d": read_pix4d_cameras,
    "pix4d-cam": read_pix4d_camera_file,
    "opf": read_opf_cameras,
    "openmvg": read_openmvg_cameras,
    "micmac": read_micmac_cameras,
    "colmap-database": read_colmap_database_cameras,
    "ossim": read_ossim_camera,
    "stac": read_stac_cameras,
}
CAMERA_FORMATS = Extended("cameras", _CAMERA_FORMATS, trouble_of_function)


def read_image_points(name: str, path: Path, layout: TableLayout) -> ImagePointRecords:
    """Read image points of a format of the register; the layout is that of a table."""
    return read_csv_image_points(path, layout) if name == TABLE else IMAGE_POINT_FORMATS[name](path)


def read_exposures(
    name: str, path: Path, order: AngleOrder, layout: TableLayout, rigs: tuple[Path, Path] | None = None
) -> ExposureRecords:
    """Read exposures of a format of the register; the layout is that of a table, the rigs of COLMAP."""
    if rigs is not None:
        return read_colmap_exposures(path, order, rigs)
    return read_csv_exposures(path, order, layout) if name == TABLE else EXPOSURE_FORMATS[name](path, order)


def read_events(name: str, path: Path, count: Count, layout: TableLayout) -> EventRecords:
    """Read events of a format of the register; count and layout are those of a table."""
    return read_csv_events(path, count, layout) if name == TABLE else EVENT_FORMATS[name](path, count)


def read_control(name: str, path: Path, layout: TableLayout) -> ControlRecords:
    """Read control points of a format of the register; the layout is that of a table."""
    return read_csv_control(path, layout) if name == TABLE else CONTROL_FORMATS[name](path)


def read_cameras(name: str, path: Path, layout: TableLayout) -> Mapping[str, CameraRecord | PixelCamera]:
    """Read cameras of a format of the register; the layout is that of a table."""
    return read_csv_cameras(path, layout) if name == TABLE else CAMERA_FORMATS[name](path)
