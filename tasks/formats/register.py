"""The formats that can be read: a new one is a new file and one line here.

Other packages add formats by entry points, see ``adjust.extensions``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias

from adjust.extensions import Extended, trouble_of_function
from tasks.formats import (
    applanix,
    bal,
    bingo,
    blocks_exchange,
    bundler,
    colmap,
    colmap_database,
    dji,
    ign_camera,
    ign_text,
    inpho,
    isat,
    metashape,
    micmac,
    native_csv,
    openmvg,
    opensfm,
    opensfm_control,
    opf,
    ossim,
    patb,
    photo_lists,
    pix4d,
    pix4d_camera_file,
    realityscan,
    rtklib,
    sbet,
    stac,
)
from tasks.formats.records import (
    AngleOrder,
    CameraRecord,
    ControlRecords,
    DistanceRecords,
    ExposureRecords,
    ImagePointRecords,
    PixelCamera,
)
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
    TABLE: native_csv.read_csv_image_points,
    "ign-mes": ign_text.read_ign_mes,
    "patb": photo_lists.read_photo_lists,
    "bingo": photo_lists.read_photo_lists,
    "inpho": inpho.read_inpho_image_points,
    "metashape-markers": metashape.read_metashape_measurements,
    "pix4d": photo_lists.read_photo_lists,
    "blocks-exchange": blocks_exchange.read_blocks_image_points,
    "colmap": colmap.read_colmap_image_points,
    "opensfm": opensfm.read_opensfm_tracks,
    "odm-gcp": opensfm.read_odm_measurements,
    "opensfm-gcp": opensfm_control.read_opensfm_measurements,
    "bundler": bundler.read_bundler_image_points,
    "opf": opf.read_opf_image_points,
    "openmvg": openmvg.read_openmvg_image_points,
    "micmac": micmac.read_micmac_image_points,
    "bal": bal.read_bal_image_points,
    "colmap-database": colmap_database.read_colmap_database_image_points,
}
IMAGE_POINT_FORMATS = Extended("image_points", _IMAGE_POINT_FORMATS, trouble_of_function)
_EXPOSURE_FORMATS: dict[str, ExposureReader] = {
    TABLE: native_csv.read_csv_exposures,
    "ign-opk": ign_text.read_ign_opk,
    "applanix": applanix.read_applanix,
    "patb": patb.read_patb_orientations,
    "bingo": bingo.read_bingo_orientations,
    "inpho": inpho.read_inpho_exposures,
    "isat": isat.read_isat_exposures,
    "metashape-opk": metashape.read_metashape_opk,
    "metashape": metashape.read_metashape_exposures,
    "pix4d": pix4d.read_pix4d_exposures,
    "blocks-exchange": blocks_exchange.read_blocks_exposures,
    "colmap": colmap.read_colmap_exposures,
    "opensfm": opensfm.read_opensfm_exposures,
    "odm-geo": opensfm.read_odm_geo,
    "bundler": bundler.read_bundler_exposures,
    "realityscan": realityscan.read_realityscan_exposures,
    "opf": opf.read_opf_exposures,
    "openmvg": openmvg.read_openmvg_exposures,
    "micmac": micmac.read_micmac_exposures,
    "bal": bal.read_bal_exposures,
    "colmap-database": colmap_database.read_colmap_database_exposures,
    "dji-mrk": dji.read_mrk_exposures,
    "stac": stac.read_stac_exposures,
}
EXPOSURE_FORMATS = Extended("exposures", _EXPOSURE_FORMATS, trouble_of_function)
TRAJECTORY_FORMATS: dict[str, TrajectoryReader] = {"sbet": sbet.read_sbet, "rtklib": rtklib.read_rtklib}
#: Exposures, and trajectories that they are taken from.
EXPOSURE_SOURCES: Extended[ExposureReader | TrajectoryReader] = Extended(
    "exposures", {**_EXPOSURE_FORMATS, **TRAJECTORY_FORMATS}, trouble_of_function
)
ACCURACY_FORMATS: dict[str, AccuracyReader] = {"smrmsg": sbet.read_smrmsg}
EVENT_FORMATS: dict[str, EventReader] = {
    TABLE: native_csv.read_csv_events,
    "dji-mrk": lambda path, _count: dji.read_mrk_events(path),
}
_CONTROL_FORMATS: dict[str, ControlReader] = {
    TABLE: native_csv.read_csv_control,
    "ign-app": ign_text.read_ign_app,
    "patb": patb.read_patb_control,
    "bingo": bingo.read_bingo_control,
    "inpho": inpho.read_inpho_control,
    "isat": isat.read_isat_control,
    "metashape-markers": metashape.read_metashape_markers,
    "blocks-exchange": blocks_exchange.read_blocks_control,
    "odm-gcp": opensfm.read_odm_control,
    "opensfm-gcp": opensfm_control.read_opensfm_control,
    "opf": opf.read_opf_control,
    "micmac": micmac.read_micmac_control,
}
CONTROL_FORMATS = Extended("control_points", _CONTROL_FORMATS, trouble_of_function)
_DISTANCE_FORMATS: dict[str, DistanceReader] = {
    TABLE: native_csv.read_csv_distances,
    "opf": opf.read_opf_distances,
}
DISTANCE_FORMATS = Extended("distances", _DISTANCE_FORMATS, trouble_of_function)
_CAMERA_FORMATS: dict[str, CameraReader] = {
    TABLE: native_csv.read_csv_cameras,
    "ign-xml": ign_camera.read_ign_cameras,
    "inpho": inpho.read_inpho_cameras,
    "isat": isat.read_isat_cameras,
    "metashape": metashape.read_metashape_cameras,
    "blocks-exchange": blocks_exchange.read_blocks_cameras,
    "colmap": colmap.read_colmap_cameras,
    "opensfm": opensfm.read_opensfm_cameras,
    "pix4d": pix4d.read_pix4d_cameras,
    "pix4d-cam": pix4d_camera_file.read_pix4d_camera_file,
    "opf": opf.read_opf_cameras,
    "openmvg": openmvg.read_openmvg_cameras,
    "micmac": micmac.read_micmac_cameras,
    "colmap-database": colmap_database.read_colmap_database_cameras,
    "ossim": ossim.read_ossim_camera,
    "stac": stac.read_stac_cameras,
}
CAMERA_FORMATS = Extended("cameras", _CAMERA_FORMATS, trouble_of_function)


def read_image_points(name: str, path: Path, layout: TableLayout) -> ImagePointRecords:
    """Read image points of a format of the register; the layout is that of a table."""
    if name == TABLE:
        return native_csv.read_csv_image_points(path, layout)
    return IMAGE_POINT_FORMATS[name](path)


def read_exposures(
    name: str, path: Path, order: AngleOrder, layout: TableLayout, rigs: tuple[Path, Path] | None = None
) -> ExposureRecords:
    """Read exposures of a format of the register; the layout is that of a table, the rigs of COLMAP."""
    if rigs is not None:
        return colmap.read_colmap_exposures(path, order, rigs)
    return (
        native_csv.read_csv_exposures(path, order, layout)
        if name == TABLE
        else EXPOSURE_FORMATS[name](path, order)
    )


def read_events(name: str, path: Path, count: Count, layout: TableLayout) -> EventRecords:
    """Read events of a format of the register; count and layout are those of a table."""
    if name == TABLE:
        return native_csv.read_csv_events(path, count, layout)
    return EVENT_FORMATS[name](path, count)


def read_control(name: str, path: Path, layout: TableLayout) -> ControlRecords:
    """Read control points of a format of the register; the layout is that of a table."""
    if name == TABLE:
        return native_csv.read_csv_control(path, layout)
    return CONTROL_FORMATS[name](path)


def read_cameras(name: str, path: Path, layout: TableLayout) -> Mapping[str, CameraRecord | PixelCamera]:
    """Read cameras of a format of the register; the layout is that of a table."""
    if name == TABLE:
        return native_csv.read_csv_cameras(path, layout)
    return CAMERA_FORMATS[name](path)
