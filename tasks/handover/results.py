"""Results of a run as other programs need them: oriented images, calibrated cameras, ground heights."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd
from pydantic import ValidationError

from adjust.arrays import Floats, Ints
from adjust.camera.additional.correction import ideal_from_measured
from adjust.camera.additional.register import AdditionalParameters
from adjust.camera.additional.selection import NOTHING
from adjust.camera.interior import FrameCamera
from adjust.geometry.rotation import from_omega_phi_kappa
from adjust.residual_grid.format_cells import Interpolation
from adjust.residual_grid.image_correction import CorrectionField
from tasks.block.residual_grid_cells import residual_grid_cells
from tasks.block.self_calibration import additional_parameters_of, image_format_of
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_frame, local_from_grid, local_from_map
from tasks.deliveries.cameras import frame_cameras
from tasks.errors import InputError, Location
from tasks.files.delivered_file import is_there
from tasks.files.json_text import from_json
from tasks.georeferencing.calibrated_cameras import calibrated_cameras
from tasks.georeferencing.calibration import SurveyedControl, calibration_of
from tasks.handover.rig_heads import RigHeads, rig_heads
from tasks.handover.rigorous import OrientedImages
from tasks.results.manifest import MANIFEST, read_manifest
from tasks.settings.adjustment import ResidualGridSettings
from tasks.settings.project import ProjectSettings
from tasks.tables.foreign import read_foreign_table
from tasks.tables.schemas.adjustment import EXTERIOR_ORIENTATIONS, OBJECT_POINTS
from tasks.tables.schemas.columns import TableSchema
from tasks.tables.schemas.deliveries import CAMERAS, EXPOSURES, FILM_ORIENTATIONS, IMAGE_POINTS, IMAGES
from tasks.tables.schemas.parameters import CORRELATIONS, PARAMETERS
from tasks.tables.schemas.residual_grid import RESIDUAL_GRID

_REMEDY = "Name a folder with the results of `aerocal run`."
# Part of the tie points of an image below, at and above which the ground is taken.
_LEVELS = (0.05, 0.5, 0.95)


@dataclass(frozen=True, eq=False)
class CalibratedCamera:
    """A camera with everything that an adjustment applied to its image points.

    Attributes
    ----------
    frame : format, pixels, focal length and principal point.
    additional, values : its additional parameters, and their values.
    grid : mean residuals that were added to its image points; None: none were.
    interpolation : between the sub-areas of the grid.
    """

    frame: FrameCamera
    additional: AdditionalParameters
    values: Floats
    grid: CorrectionField | None = None
    interpolation: Interpolation = "bilinear"

    def ideal(self, xy: Floats) -> Floats:
        """Ideal image points (n, 2) from the principal point, of measured ones from the centre; metres.

        Without the mean residuals.
        """
        reduced = xy - np.array(self.frame.principal_point)
        return ideal_from_measured(self.additional, self.values, reduced)

    def corrected(self, xy: Floats) -> Floats:
        """The same with the mean residuals."""
        reduced = xy - np.array(self.frame.principal_point)
        return ideal_from_measured(self.additional, self.values, reduced, self.mean_residuals(xy))

    def mean_residuals(self, xy: Floats) -> Floats:
        """Mean residuals (n, 2) added at measured points (n, 2), metres; zero where none were."""
        if self.grid is None:
            return np.zeros_like(xy)
        return self.grid.cells.interpolate(self.grid.value, xy, self.interpolation)

    @property
    def _over_format(self) -> Floats:
        """(441, 2) points from the centre, metres."""
        steps = np.linspace(-1.0, 1.0, 21)
        xy = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        return np.asarray(xy * np.array(self.frame.half_format))

    @property
    def digest_of_corrections(self) -> str:
        """12 digits that differ from those of a camera whose corrections differ by 1 nm."""
        xy = self._over_format
        shift = self.corrected(xy) - (xy - np.array(self.frame.principal_point))
        return hashlib.sha256((np.rint(1e9 * shift) + 0.0).tobytes()).hexdigest()[:12]

    @property
    def largest_distortion(self) -> float:
        """Largest correction by the additional parameters over the format, metres."""
        xy = self._over_format
        reduced = xy - np.array(self.frame.principal_point)
        return float(np.linalg.norm(self.ideal(xy) - reduced, axis=1).max())

    @property
    def largest_mean_residual(self) -> float:
        """Largest correction by mean residuals, metres; zero without any."""
        if self.grid is None:
            return 0.0
        return float(np.linalg.norm(np.nan_to_num(self.grid.value), axis=1).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Results:
    """An adjusted block as it is handed over.

    Attributes
    ----------
    images : names, orientations, cameras.
    cameras : in the order of ``images.camera``.
    orientations : exterior_orientations.parquet, in the order of the images.
    strips : name of the strip of each image; empty without.
    ground : (n, 3) low, middle and high map height of the tie points below each image, metres.
    name, flown : of the project; None: the date is not stated.
    heads : which images heads of a rig took together; None: there is no rig.
    film : names of the cameras that expose film.
    """

    images: OrientedImages
    cameras: tuple[CalibratedCamera, ...]
    orientations: pd.DataFrame
    strips: tuple[str, ...]
    ground: Floats
    name: str
    flown: date | None = None
    heads: RigHeads | None = None
    film: frozenset[str] = frozenset()

    @property
    def needed_date(self) -> date:
        """The date of the flight, for formats that require it.

        Raises
        ------
        InputError
            If the project does not state it.
        """
        if self.flown is None:
            raise InputError(
                "This format needs the date of the flight, which the project does not state.",
                "Declare it in the project file (flown = 2026-05-24) and run again; nothing is recomputed.",
                entity="project.flown",
            )
        return self.flown


def read_results(folder: Path) -> Results:
    """The results in a folder.

    Raises
    ------
    InputError
        If there are none, or a table is missing.
    """
    stated, place, refracted, interpolation = _stated(folder)
    orientations = read_result_table(folder, EXTERIOR_ORIENTATIONS)
    if orientations.empty:
        raise Location(folder).error("The results have no adjusted orientation.", _REMEDY)
    cameras = _cameras(folder, interpolation)
    names = [str(name) for name in orientations["image"]]
    taken = read_result_table(folder, IMAGES).set_index("image").loc[names]
    index = pd.Index([item.frame.name for item in cameras]).get_indexer(pd.Index(taken["camera"]))
    images = replace(_oriented(place, orientations, index.astype(np.int64), cameras), refracted=refracted)
    strips = tuple(str(strip) for strip in taken["strip"].fillna(""))
    heads = _heads(folder, [one.frame.name for one in cameras], names)
    ground = _ground(folder, names)
    film = film_cameras(folder)
    found = Results(images, cameras, orientations, strips, ground, stated.name, stated.flown, heads, film)
    return with_images_only(found)


def film_cameras(folder: Path) -> frozenset[str]:
    """Names of the cameras whose images have fiducial marks."""
    if not (folder / f"{FILM_ORIENTATIONS.name}.parquet").exists():
        return frozenset()
    return frozenset(read_result_table(folder, FILM_ORIENTATIONS)["camera"].astype(str))


def with_images_only(results: Results) -> Results:
    """The results without cameras that took no image, as the virtual image of a platform."""
    taken, images, heads = np.unique(results.images.camera), results.images, results.heads
    number = np.full(len(results.cameras), -1)
    number[taken] = np.arange(len(taken))
    images = replace(
        images,
        camera=number[images.camera],
        focal_length=images.focal_length[taken],
        half_format=images.half_format[taken],
        pixel_size=images.pixel_size[taken],
    )
    if heads is not None:
        heads = replace(heads, reference=number[heads.reference[taken]])
    return replace(results, images=images, cameras=tuple(results.cameras[k] for k in taken), heads=heads)


def _heads(folder: Path, cameras: list[str], names: list[str]) -> RigHeads | None:
    """Heads of rigs among the cameras, in their order, and the events of the images."""
    rows = read_result_table(folder, CAMERAS).set_index("camera", drop=False).loc[cameras]
    if rows["head_of"].isna().all():
        return None
    return rig_heads(read_result_table(folder, EXPOSURES), rows, names)


def read_cameras(folder: Path) -> tuple[dict[str, CalibratedCamera], dict[str, str]]:
    """The calibrated cameras in a folder of results by their names, and the name of the camera of each image.

    Raises
    ------
    InputError
        As of `read_results`.
    """
    interpolation = _stated(folder)[3]
    cameras = {camera.frame.name: camera for camera in _cameras(folder, interpolation)}
    images = read_result_table(folder, IMAGES)
    return cameras, {
        str(image): str(camera)
        for image, camera in zip(images["image"], images["camera"], strict=True)
        if str(camera) in cameras
    }


def _cameras(folder: Path, interpolation: Interpolation) -> tuple[CalibratedCamera, ...]:
    """The cameras that have images, with what was found of them."""
    grids = read_result_table(folder, RESIDUAL_GRID)
    return tuple(
        replace(
            calibrated_camera(row),
            grid=_mean_residuals(str(row["camera"]), grids),
            interpolation=interpolation,
        )
        for row in _camera_rows(folder)
    )


def _mean_residuals(camera: str, grids: pd.DataFrame) -> CorrectionField | None:
    """What was added to the image points of a camera, from residual_grid.parquet."""
    own = grids[grids["camera"] == camera].sort_values(["row", "column"])
    value = own[["correction_x_um", "correction_y_um"]].to_numpy(np.float64) * 1e-6
    return CorrectionField(residual_grid_cells(own), value) if np.isfinite(value).any() else None


def _stated(folder: Path) -> tuple[ProjectSettings, MapFrame, bool, Interpolation]:
    """Its project, the CRS of its results, whether refraction was corrected, interpolation of residuals."""
    manifest = read_manifest(folder) if is_there(folder / MANIFEST) else None
    if manifest is None:
        raise Location(folder).error("There are no results of a run.", _REMEDY)
    settings = cast("dict[str, dict[str, object]]", dict(manifest.settings))
    try:
        project, adjustment = dict(settings["project"]), settings["adjustment"]
        if not any(cast("dict[str, object]", project["heights"]).values()):
            project["heights"] = "ellipsoidal"
        stated = ProjectSettings.model_validate(project)
        refracted = adjustment["refraction"] == "standard"
        grid = ResidualGridSettings.model_validate(adjustment["residual_grid"])
    except (KeyError, AttributeError, ValidationError) as error:
        raise Location(folder).error(
            "The manifest does not contain the settings of the adjustment.", _REMEDY
        ) from error
    return stated, MapFrame.of(stated.crs, stated.heights), refracted, grid.interpolation


def read_result_table(folder: Path, schema: TableSchema) -> pd.DataFrame:
    """A table of the results in a folder.

    Raises
    ------
    InputError
        If it is missing, or is none.
    """
    # The folder may be named by a path with links, or from another folder (../results).
    return read_foreign_table((folder / f"{schema.name}.parquet").resolve(), schema, _REMEDY)[0]


def _camera_rows(folder: Path) -> list[dict[object, object]]:
    """Rows of cameras.parquet with the adjusted values, for the cameras that have images."""
    parameters, correlations = (
        read_result_table(folder, PARAMETERS),
        read_result_table(folder, CORRELATIONS),
    )
    adjusted = calibration_of(parameters, correlations, SurveyedControl())
    given = read_result_table(folder, CAMERAS)
    given = given[given["camera"].isin(adjusted.entities("focal_length"))]
    return [dict(row) for row in calibrated_cameras(given, adjusted).to_dict("records")]


def calibrated_camera(row: dict[object, object]) -> CalibratedCamera:
    """A camera of a row of cameras.parquet."""
    known = from_json(str(row["additional_parameters"]))
    turn = int(str(row["calibration_axes_deg"]))
    frame = next(iter(frame_cameras(pd.DataFrame([row])).values()))
    additional = additional_parameters_of(
        frame.name, "+".join(known) or NOTHING, image_format_of(row, turn), turn
    )
    return CalibratedCamera(frame, additional, np.array([known[name] for name in additional.names]))


def _oriented(
    place: MapFrame, orientations: pd.DataFrame, camera: Ints, cameras: tuple[CalibratedCamera, ...]
) -> OrientedImages:
    centre = orientations[["x_m", "y_m", "z_m"]].to_numpy(np.float64)
    angles = np.deg2rad(orientations[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy(np.float64))
    frame = local_frame(place, centre)
    return OrientedImages(
        tuple(str(name) for name in orientations["image"]),
        camera,
        place,
        frame,
        local_from_map(place, frame, centre),
        np.asarray(local_from_grid(place, frame, centre) @ from_omega_phi_kappa(angles)),
        np.array([item.frame.focal_length for item in cameras]),
        np.array([item.frame.half_format for item in cameras]),
        np.array([item.frame.pixel_size for item in cameras]),
    )


def _ground(folder: Path, names: list[str]) -> Floats:
    points = read_result_table(folder, OBJECT_POINTS)
    return ground_heights(points, read_result_table(folder, IMAGE_POINTS), names)


def ground_heights(points: pd.DataFrame, measured: pd.DataFrame, names: list[str]) -> Floats:
    """Low, middle and high map height (n, 3) of the points in each image; of all where an image has none.

    Parameters
    ----------
    points : columns point, z_m.  measured : columns image, point.
    """
    known = points.set_index("point")["z_m"]
    height = measured["point"].map(known).astype(np.float64)
    levels = height.groupby(measured["image"].astype(str)).quantile(np.array(_LEVELS)).unstack()
    of_all = np.nanquantile(known.to_numpy(np.float64), _LEVELS)
    found = levels.reindex(names).to_numpy(np.float64)
    return np.where(np.isfinite(found), found, of_all)
