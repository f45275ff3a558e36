"""The material of the report: the tables of the contract, read once, and a few derived quantities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.camera.interior import FrameCamera
from adjust.residual_grid.residual_grid import LEAST_REDUNDANCY
from tasks.block.strip_names import strip_names
from tasks.deliveries.cameras import frame_cameras
from tasks.documents.report.surveyed_differences import with_ratios
from tasks.files.in_turn import in_turn
from tasks.quantities import observation_group
from tasks.results.figures import AdjustmentFigures, figures_of
from tasks.results.summary import Summary, summary_of
from tasks.settings.project import Project
from tasks.store.artifact import Artifact
from tasks.store.notes import read_notes
from tasks.tables.parquet import read_table
from tasks.tables.places import places_of

IMAGE_POINTS = "image_points"
#: Status of residuals that were used in the adjustment.
TOOK_PART = ("used", "uncontrolled")
# Tables in which names repeat, and what report and certificate show of them.
_LONG = {
    "image_points": ("image", "point", "x_mm", "y_mm", "sigma_x_mm", "sigma_y_mm"),
    "residuals": (
        *("group", "image", "point", "component"),
        *("residual", "sigma", "unit", "redundancy", "standardized", "status"),
    ),
}


@dataclass(frozen=True, eq=False)
class Material:
    """The tables of one adjustment, and its figures.

    Attributes
    ----------
    project : the settings of the run.
    summary : what summary.json says, without timings.
    cameras : by name.
    camera_table : as cameras.parquet, with the layout of the CCD images and the calibration axes.
    images : of the block, with their orientation (left join: an image without attitude has none).
    image_points, control_points, object_points, residuals, parameters, correlations, control_residuals,
        check_points, distance_residuals, model_alternatives, residual_grid, residual_autocorrelation : the
        tables of these names; of image points and residuals the columns that are shown.
    self_calibration : the additional parameters that were offered; empty without any.
    trust_map : trust_map_cells; empty without a trust map.
    strip_means : orientation_difference_means of a two-step calibration; empty without one.
    exposures, trajectories : the tables of these names; empty if no exposures come from a trajectory.
    neighbours : neighbouring_images; empty if there are none.
    platform, virtual_image : the tables of these names; empty without a calibrated platform.
    suspicions : those of the problems that say the delivery itself is wrong.
    """

    project: Project
    summary: Summary
    cameras: Mapping[str, FrameCamera]
    camera_table: pd.DataFrame
    images: pd.DataFrame
    image_points: pd.DataFrame
    control_points: pd.DataFrame
    object_points: pd.DataFrame
    residuals: pd.DataFrame
    parameters: pd.DataFrame
    correlations: pd.DataFrame
    control_residuals: pd.DataFrame
    check_points: pd.DataFrame
    distance_residuals: pd.DataFrame
    model_alternatives: pd.DataFrame
    residual_grid: pd.DataFrame
    residual_autocorrelation: pd.DataFrame
    self_calibration: pd.DataFrame
    strip_means: pd.DataFrame = field(default_factory=pd.DataFrame)
    exposures: pd.DataFrame = field(default_factory=pd.DataFrame)
    trajectories: pd.DataFrame = field(default_factory=pd.DataFrame)
    trust_map: pd.DataFrame = field(default_factory=pd.DataFrame)
    neighbours: pd.DataFrame = field(default_factory=pd.DataFrame)
    platform: pd.DataFrame = field(default_factory=pd.DataFrame)
    virtual_image: pd.DataFrame = field(default_factory=pd.DataFrame)
    suspicions: tuple[str, ...] = ()

    @cached_property
    def figures(self) -> AdjustmentFigures:
        """Figures of the adjustment beyond the contract of summary.json."""
        return figures_of(self.summary.model_extra)

    @cached_property
    def oriented(self) -> pd.DataFrame:
        """Adjusted images in the order of flight: by strip, then by name.

        Besides the columns of ``images`` and ``exterior_orientations``: gsd_m, ground_m (mean height of the
        terrain in the image, the block's where the image has none).
        """
        table = self.images[self.images["x_m"].notna()].copy()
        table["strip"] = strip_names(table["flight"].fillna(""), table["strip"].fillna(""))
        table = table.sort_values(["strip", "image"], kind="stable", ignore_index=True)
        height = table["height_above_ground_m"].to_numpy(np.float64)
        known = self.object_points["z_m"].to_numpy(np.float64)
        terrain = float(np.median(known)) if len(known) else 0.0
        height = np.where(np.isfinite(height), height, table["z_m"].to_numpy(np.float64) - terrain)
        cameras = [self.cameras[name] for name in table["camera"]]
        ratio = np.array([camera.pixel_size / camera.focal_length for camera in cameras])
        table["gsd_m"] = height * ratio
        table["ground_m"] = table["z_m"] - height
        return table

    def strips_of(self, images: pd.Series) -> list[str]:
        """Strip (n,) of each named image; empty where none of the oriented images is named."""
        strips = dict(zip(self.oriented["image"], self.oriented["strip"], strict=True))
        return [strips.get(name, "") for name in images]

    @cached_property
    def gsd_m(self) -> float:
        """Ground sampling distance: the median over the images, m; NaN without images."""
        return float(self.oriented["gsd_m"].median())

    @cached_property
    def image_residuals(self) -> pd.DataFrame:
        """One row for each image point: camera, x_mm, y_mm, vx_um, vy_um, wx, wy, used, shows_x, shows_y.

        ``used`` says that both components were used; ``shows_x`` and ``shows_y`` that a component shows
        errors, because others control it: these make the mean residuals.
        """
        places = self.image_points
        x, y = (self._component(name) for name in ("x", "y"))
        camera, names = pd.factorize(self.images["camera"])
        return pd.DataFrame(
            {
                "image": places["image"],
                "point": places["point"],
                "camera": pd.Categorical.from_codes(
                    camera[places_of(places["image"], self.images["image"])], categories=names
                ),
                "x_mm": places["x_mm"],
                "y_mm": places["y_mm"],
                "vx_um": x["residual"],
                "vy_um": y["residual"],
                "wx": x["standardized"],
                "wy": y["standardized"],
                "used": x["status"].isin(TOOK_PART) & y["status"].isin(TOOK_PART),
                "shows_x": (x["status"] == "used") & (x["redundancy"] > LEAST_REDUNDANCY),
                "shows_y": (y["status"] == "used") & (y["redundancy"] > LEAST_REDUNDANCY),
            }
        )

    def _component(self, name: str) -> pd.DataFrame:
        """Residuals of a component of all image points, in the order of image_points.parquet.

        Both tables are in the order of their keys, so nothing has to be joined.
        """
        columns = ["image", "point", "residual", "redundancy", "standardized", "status"]
        chosen = (self.residuals["group"] == IMAGE_POINTS) & (self.residuals["component"] == name)
        own = self.residuals.loc[chosen, columns].reset_index(drop=True)
        if not all(_are_same(own[column], self.image_points[column]) for column in ("image", "point")):
            raise ValueError("residuals.parquet and image_points.parquet have other image points")
        return own

    @cached_property
    def standardized(self) -> dict[str, Floats]:
        """Standardized residuals (n,) of the controlled observations that were used, of each group."""
        number, names = pd.factorize(self.residuals["group"])
        of_name = [observation_group(str(name)) for name in names]
        groups = list(dict.fromkeys(of_name))
        number = np.array([groups.index(group) for group in of_name], dtype=np.int64)[number]
        values = self.residuals["standardized"].to_numpy(np.float64)
        tested = (self.residuals["status"] == "used").to_numpy() & np.isfinite(values)
        return {group: values[tested & (number == k)] for k, group in enumerate(groups)}

    def differences(self, is_check: bool) -> pd.DataFrame:
        """The table of control or check points with the columns that ``with_ratios`` adds."""
        return self._check_differences if is_check else self._control_differences

    @cached_property
    def _control_differences(self) -> pd.DataFrame:
        table = self.control_residuals
        return with_ratios(table, self.gsd_at(table["point"]), is_check=False)

    @cached_property
    def _check_differences(self) -> pd.DataFrame:
        table = self.check_points
        return with_ratios(table, self.gsd_at(table["point"]), is_check=True)

    def gsd_at(self, points: pd.Series) -> Floats:
        """Ground sampling distance (n,) at named points: the median of the images that measure each."""
        gsd = dict(zip(self.oriented["image"], self.oriented["gsd_m"], strict=True))
        rays = self.image_points[places_of(self.image_points["point"], points) >= 0]
        by_point = rays["image"].map(gsd).astype(np.float64).groupby(rays["point"].astype(str)).median()
        return np.asarray(points.map(by_point).fillna(self.gsd_m), np.float64)


def read_material(stages: Sequence[Mapping[str, Artifact]], project: Project) -> Material:
    """Read everything the report shows.

    Parameters
    ----------
    stages : the outputs of all stages by name, in the order in which they ran.
    """
    tables = {name: artifact for outputs in stages for name, artifact in outputs.items()}
    names = (
        "images",
        "image_points",
        "control_points",
        "object_points",
        "residuals",
        "parameters",
        "correlations",
        "control_residuals",
        "check_points",
        "distance_residuals",
        "model_alternatives",
        "residual_grid",
        "residual_autocorrelation",
    )

    def of(name: str) -> pd.DataFrame:
        return read_table(tables[name], categories=name in _LONG, columns=_LONG.get(name))

    # To make categories of one table takes as long as to read the next one.
    read = dict(zip(names, in_turn(of, names, threads=2), strict=True))
    orientations = read_table(tables["exterior_orientations"])
    read["images"] = read["images"].merge(orientations, on="image", how="left", validate="one_to_one")
    optional = {
        "self_calibration": "self_calibration",
        "strip_means": "orientation_difference_means",
        "trust_map": "trust_map_cells",
        "neighbours": "neighbouring_images",
        "platform": "platform",
        "virtual_image": "virtual_image",
    }
    read |= {"self_calibration": pd.DataFrame()}
    read |= {field: read_table(tables[name]) for field, name in optional.items() if name in tables}
    camera_table = read_table(tables["cameras"])
    notes = [read_notes(outputs["notes"]) for outputs in stages]
    return Material(
        project=project,
        summary=summary_of(notes, project.gates, {}),
        cameras=frame_cameras(camera_table),
        camera_table=camera_table,
        exposures=read_table(tables["exposures"]) if "trajectories" in tables else pd.DataFrame(),
        trajectories=read_table(tables["trajectories"]) if "trajectories" in tables else pd.DataFrame(),
        suspicions=tuple(dict.fromkeys(sentence for note in notes for sentence in note.suspicions)),
        **read,
    )


def _are_same(one: pd.Series, other: pd.Series) -> bool:
    """Whether two columns of categories have the same texts."""
    if len(one) != len(other):
        return False
    first, second = one.cat.codes.to_numpy(), other.cat.codes.to_numpy()
    place = np.full(len(other.cat.categories) + 1, -1)
    place[second] = first
    named = place[:-1] >= 0
    return bool(
        np.array_equal(place[second], first)
        and one.cat.categories[place[:-1][named]].equals(other.cat.categories[named])
    )
