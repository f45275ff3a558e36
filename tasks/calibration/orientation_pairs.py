"""Adjusted and observed orientations of the same images, side by side in one local frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.calibration.orientation_differences import (
    OrientationDifferences,
    OrientationPairs,
    orientation_differences,
)
from tasks.block.given_orientations import GivenOrientations, Mountings
from tasks.block.oriented_images import has_attitude, has_position
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_frame
from tasks.errors import InputError

_XYZ = ["x_m", "y_m", "z_m"]
_OPK = ["omega_deg", "phi_deg", "kappa_deg"]
_SIGMAS = [f"sigma_{name}" for name in (*_XYZ, *_OPK)]
_HEADING = ["heading_deg", "pitch_deg", "roll_deg"]


@dataclass(frozen=True, eq=False)
class CameraDifferences:
    """Differences of the images of one camera.

    Attributes
    ----------
    camera : its name.
    image : (n,) names.
    strip_names, flight_names : by number.
    differences : those of each image.
    body_from_camera : (3, 3) nominal mounting T.
    given_lever_arm : (3,) of the project file, metres, body axes.
    attitude_sigma, position_sigma : medians of the stated σ of the observed orientations: roll, pitch, yaw
        (3,) in radians, and one axis of the plan in metres.
    """

    camera: str
    image: tuple[str, ...]
    strip_names: tuple[str, ...]
    flight_names: tuple[str, ...]
    differences: OrientationDifferences
    body_from_camera: Floats
    given_lever_arm: Floats
    attitude_sigma: Floats
    position_sigma: float


@dataclass(frozen=True, eq=False)
class PairedOrientations:
    """All cameras, and how many images have no partner.

    Attributes
    ----------
    cameras : ascending by name.
    only_adjusted, only_observed : number of images in only one of the tables.
    """

    cameras: tuple[CameraDifferences, ...]
    only_adjusted: int
    only_observed: int


def paired_orientations(
    exposures: pd.DataFrame, adjusted: pd.DataFrame, cameras: pd.DataFrame, frame: MapFrame
) -> PairedOrientations:
    """Differences of all images with an adjusted and a complete observed orientation.

    Parameters
    ----------
    exposures : observed, as exposures.parquet.
    adjusted : exterior_orientations.parquet, whose standard deviations give the weights, or an external
        result read as exposures, whose standard deviations are only assumed and not used.

    Raises
    ------
    InputError
        If no image is in both, or the external result is not one of projection centres with ω, φ, κ.
    """
    external = "position" in adjusted.columns
    if external:
        _require_projection_centres(adjusted)
    complete = has_position(exposures) & has_attitude(exposures)
    observed = exposures[complete & exposures["image"].isin(adjusted["image"])]
    if observed.empty:
        raise InputError(
            "No image has both an adjusted and a complete observed orientation.",
            "Check that both files use the same image names, and that the observed orientations have three "
            "angles.",
        )
    observed = observed.sort_values("image").reset_index(drop=True)
    result = adjusted.set_index("image").loc[observed["image"]].reset_index()
    found = tuple(
        _of_camera(str(name), observed.loc[own], result.loc[own], cameras, frame, weighted=not external)
        for name, own in observed.groupby("camera", sort=True).groups.items()
    )
    return PairedOrientations(
        found, int((~adjusted["image"].isin(observed["image"])).sum()), len(exposures) - len(observed)
    )


def _require_projection_centres(adjusted: pd.DataFrame) -> None:
    wrong = adjusted[
        (adjusted["position"] != "projection_centre") | adjusted[[*_XYZ, *_OPK]].isna().any(axis=1)
    ]
    if len(wrong):
        raise InputError(
            f"{len(wrong):,} adjusted orientations are not given as projection centres with ω, φ, κ.",
            'If they come from an adjustment, declare position = "projection_centre" and the angles.',
            entity=f"image {wrong['image'].iloc[0]}",
        )


def _of_camera(
    camera: str,
    observed: pd.DataFrame,
    adjusted: pd.DataFrame,
    cameras: pd.DataFrame,
    frame: MapFrame,
    *,
    weighted: bool,
) -> CameraDifferences:
    mountings = Mountings.from_table(cameras[cameras["camera"] == camera])
    local = local_frame(frame, observed[_XYZ].to_numpy(np.float64))
    given = GivenOrientations.from_tables(observed, mountings, frame, local)
    # An adjusted projection centre is what it is: no lever arm was taken off.
    nothing = pd.DataFrame(np.nan, index=observed.index, columns=[*_SIGMAS, *_HEADING])
    columns = [*_XYZ, *_OPK, *(_SIGMAS if weighted else ())]
    result = GivenOrientations.from_tables(
        observed.assign(**nothing, position="antenna").assign(**adjusted[columns]), mountings, frame, local
    )
    body_from_camera = given.body_from_camera
    pairs = OrientationPairs(
        result.observed,
        result.local_from_body() @ body_from_camera,
        given.observed,
        given.local_from_body(),
        body_from_camera,
        given.local_from_enu,
    )
    timed = bool(np.isfinite(given.time_s).all())
    differences = orientation_differences(
        pairs,
        given.strip_of_image,
        given.flight_of_image,
        given.time_s if timed else np.arange(len(given.image), dtype=np.float64),
        observed["z_m"].to_numpy(np.float64),
        _covariance(given) + _covariance(result) if weighted else None,
        mountings.lever_arm[0],
    )
    return CameraDifferences(
        camera,
        given.image,
        given.strips,
        given.flights,
        differences,
        mountings.body_from_camera[0],
        mountings.lever_arm[0],
        np.sqrt(np.median(np.diagonal(given.attitude_covariance(), axis1=1, axis2=2), axis=0)),
        float(np.median(np.linalg.norm(given.position_sigma[:, :2], axis=1)) / np.sqrt(2.0)),
    )


def _covariance(orientations: GivenOrientations) -> Floats:
    """(n, 6, 6): small rotation in body axes, rad², and position in the local frame, m²."""
    covariance = np.zeros((len(orientations.image), 6, 6))
    covariance[:, :3, :3] = orientations.attitude_covariance()
    spread = orientations.local_from_grid * orientations.position_sigma[:, None, :]
    covariance[:, 3:, 3:] = spread @ np.swapaxes(spread, 1, 2)
    return covariance
