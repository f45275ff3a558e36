"""The images of a block and their orientations: given, found from image points, or taken from strips.

Without INS, attitudes are those of level flight along the strip. The heading is the direction from
exposure to exposure, in the order of time, or of the image names where there is no time. Names may count
against the flight; of the two directions the one is taken with which the rays of the strip's points meet
in front of the cameras.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from adjust.approximate.intersection import intersect
from adjust.arrays import Bools, Floats, Ints
from adjust.geometry import rotation
from tasks.block.block_input import block_of, image_point_observations
from tasks.block.exposure_events import first_of_events, joined_images
from tasks.block.given_orientations import GivenOrientations, Mountings, of_another_camera
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_frame
from tasks.errors import InputError
from tasks.plain_text import some_of
from tasks.settings.adjustment import AdjustmentSettings
from tasks.tables.number_columns import numbers_of
from tasks.tables.places import distinct, places_of

XYZ_M = ["x_m", "y_m", "z_m"]
OPK_DEG = ["omega_deg", "phi_deg", "kappa_deg"]
HEADING_DEG = ["heading_deg", "pitch_deg", "roll_deg"]
_SIGMA_M = ["sigma_x_m", "sigma_y_m", "sigma_z_m"]
_SIGMA_DEG = [f"sigma_{name}" for name in (*OPK_DEG, *HEADING_DEG)]


def measured_exposures(
    exposures: pd.DataFrame, cameras: pd.DataFrame, measured: pd.DataFrame
) -> pd.DataFrame:
    """Rows of exposures.parquet of the images that are measured; an image alone gets an empty one."""
    images = distinct(measured["image"])
    own = exposures[places_of(exposures["image"], images) >= 0]
    alone = [images[i] for i in np.flatnonzero(places_of(images, own["image"]) < 0)]
    if not alone:
        return _as_their_events(own, cameras)
    # The import has made sure that there is one camera only.
    rows = pd.DataFrame(
        {"image": alone, "camera": cameras["camera"].iloc[0], "position": "projection_centre"}
    )
    return pd.concat([own, rows.reindex(columns=own.columns).astype(own.dtypes)]).sort_values(
        "image", ignore_index=True
    )


def has_position(exposures: pd.DataFrame) -> Bools:
    """(n,) which exposures have a position."""
    return _all_known(exposures, XYZ_M)


def has_attitude(exposures: pd.DataFrame) -> Bools:
    """(n,) which exposures have three angles."""
    return _all_known(exposures, OPK_DEG) | _all_known(exposures, HEADING_DEG)


def _all_known(exposures: pd.DataFrame, columns: list[str]) -> Bools:
    return np.asarray(~np.isnan(numbers_of(exposures, columns)).any(axis=1))


def oriented_images(
    exposures: pd.DataFrame,
    cameras: pd.DataFrame,
    measured: pd.DataFrame,
    map_frame: MapFrame,
    found: pd.DataFrame | None = None,
) -> tuple[GivenOrientations, AdjustmentFrame, tuple[str, ...]]:
    """Orientations of the measured images, the local frame, and the images that have none.

    Parameters
    ----------
    found : approximate_orientations.parquet, for what was not given; None: only what was given is wanted.

    Raises
    ------
    InputError
        If no measured image can be oriented.
    """
    own = measured_exposures(exposures, cameras, measured)
    if len(own) == 0:
        raise InputError(
            "No image point lies in an image of the exposures.", "Check that both use the same image names."
        )
    if found is not None:
        own = _as_their_events(_completed(own, found, Mountings.from_table(cameras)), cameras)
    used = cameras["camera"].isin(own["camera"].unique())
    # The reference head of a rig may take no image itself.
    used |= cameras["camera"].isin(cameras.loc[used, "head_of"].dropna())
    mountings = Mountings.from_table(cameras[used])
    placed = own[has_position(own)]
    if len(placed) == 0:
        raise InputError(*_nothing_oriented(own, measured))
    frame = local_frame(map_frame, numbers_of(placed, XYZ_M))
    given = GivenOrientations.from_tables(placed, mountings, map_frame, frame)
    given = with_track_attitudes(given, frame, measured)
    oriented = {name for name, known in zip(given.image, given.has_attitude, strict=True) if known}
    if not oriented:
        raise InputError(*_nothing_oriented(own, measured))
    unoriented = tuple(name for name in own["image"] if name not in oriented)
    return given.only(given.has_attitude), frame, unoriented


def _completed(own: pd.DataFrame, found: pd.DataFrame, mountings: Mountings) -> pd.DataFrame:
    """Exposures with approximate values, which have no standard deviation, where nothing was given.

    Found angles are those of the image itself, given ones those of a camera in its nominal mounting.
    """
    result = own.reset_index(drop=True)
    row = pd.Index(found["image"]).get_indexer(pd.Index(result["image"]))
    new_place, new_angles = (row >= 0) & ~has_position(result), (row >= 0) & ~has_attitude(result)
    if not (new_place | new_angles).any():
        return result
    camera = pd.Index(mountings.names).get_indexer(pd.Index(result["camera"]))[new_angles]
    of_image = rotation.from_omega_phi_kappa(np.deg2rad(numbers_of(found, OPK_DEG)[row[new_angles]]))
    nominal = rotation.to_omega_phi_kappa(of_image @ mountings.nominal_from_camera[camera])
    result.loc[new_place, XYZ_M] = numbers_of(found, XYZ_M)[row[new_place]]
    result.loc[new_angles, OPK_DEG] = np.rad2deg(nominal)
    for chosen, sigmas in ((new_place, _SIGMA_M), (new_angles, _SIGMA_DEG)):
        result.loc[chosen, sigmas] = np.nan
    result.loc[new_place, "position"] = "projection_centre"
    return result


def _as_their_events(exposures: pd.DataFrame, cameras: pd.DataFrame) -> pd.DataFrame:
    """Exposures; images of heads without position or attitude get those of another head in their event.

    These are approximate values, without standard deviation: the reading of the event is that of the other.
    """
    if cameras["head_of"].isna().all() or (has_position(exposures) & has_attitude(exposures)).all():
        return exposures
    mountings = Mountings.from_table(cameras)
    result = exposures.reset_index(drop=True)
    camera = pd.Index(mountings.names).get_indexer(pd.Index(result["camera"])).astype(np.int64)
    event = joined_images(
        result["time_s"].to_numpy(np.float64),
        pd.factorize(result["flight"], use_na_sentinel=False)[0].astype(np.int64),
        result["event"].fillna("").to_numpy(np.str_),
        mountings.reference[camera],
        (np.bincount(mountings.reference) > 1)[mountings.reference[camera]],
    )
    for known, columns, sigmas in (
        (has_position(result), [*XYZ_M, "position"], _SIGMA_M),
        (has_attitude(result), [*OPK_DEG, *HEADING_DEG], _SIGMA_DEG),
    ):
        other = first_of_events(event, ~known)[event]
        taking = np.flatnonzero(~known & known[other])
        result.loc[taking, columns] = result.loc[other[taking], columns].to_numpy()
        result.loc[taking, sigmas] = np.nan
        if OPK_DEG[0] in columns:
            angles = np.deg2rad(result.loc[taking, OPK_DEG].to_numpy(np.float64))
            turned = of_another_camera(
                angles, mountings.body_from_camera, camera[other[taking]], camera[taking]
            )
            result.loc[taking, OPK_DEG] = np.rad2deg(turned)
    return result


def _nothing_oriented(own: pd.DataFrame, measured: pd.DataFrame) -> tuple[str, str]:
    """What is wrong and what to do if no image has an orientation."""
    lacking = [
        f"{int((~known).sum()):,} have no {what}"
        for known, what in ((has_position(own), "position"), (has_attitude(own), "attitude"))
        if not known.all()
    ]
    images = measured.groupby("point")["image"].nunique()
    return (
        f"None of the {len(own):,} measured images has an orientation ({', '.join(lacking)}; "
        f"{some_of(own['image'])}), and their image points do "
        f"not determine one: {int((images >= 2).sum()):,} points are measured in several images.",
        "Measure at least 8 points common to two images, and 6 points common to every further image and "
        "the others; or give positions and ω, φ, κ (or heading, pitch, roll), or positions of named "
        "strips, which show the heading.",
    )


# What level flight along the track is good for: crab angle and tilts.
_SIGMA = float(np.deg2rad(5.0))
# Points that decide about the direction of a strip.
_TRIAL_POINTS = 500


def with_track_attitudes(
    given: GivenOrientations, frame: AdjustmentFrame, measured: pd.DataFrame
) -> GivenOrientations:
    """The orientations, with attitudes from the track for exposures that have none.

    Exposures that are alone in their strip keep none. ``attitude_observed`` stays false for all of them.
    """
    missing = ~given.has_attitude
    if not missing.any():
        return given
    headings = _track_headings(given)
    fill = missing & np.isfinite(headings)
    completed = _filled(given, fill, headings)
    for strip in np.unique(given.strip_of_image[fill]):
        own = fill & (given.strip_of_image == strip)
        if np.isfinite(given.time_s[own]).all():
            continue
        reversed_headings = np.where(own, headings + np.pi, headings)
        turned = _filled(given, fill, reversed_headings)
        if _in_front(turned, frame, measured, own) > _in_front(completed, frame, measured, own):
            completed, headings = turned, reversed_headings
    return completed


def _track_headings(given: GivenOrientations) -> Floats:
    """Heading (n,) of the track, radians from true north; NaN for an exposure alone in its strip."""
    headings = np.full(len(given.image), np.nan)
    for strip in np.unique(given.strip_of_image):
        index = np.flatnonzero(given.strip_of_image == strip)
        if len(index) < 2:
            continue
        if np.isfinite(given.time_s[index]).all():
            index = index[np.argsort(given.time_s[index], kind="stable")]
        along = np.gradient(given.observed[index], axis=0)
        enu = np.einsum("nji,nj->ni", given.local_from_enu[index], along)
        headings[index] = np.arctan2(enu[:, 0], enu[:, 1])
    return headings


def _filled(given: GivenOrientations, fill: np.ndarray, headings: Floats) -> GivenOrientations:
    """Level attitudes with the given headings where ``fill`` is true."""
    level = np.stack([headings, np.zeros_like(headings), np.zeros_like(headings)], axis=1)
    return replace(
        given,
        angles=np.where(fill[:, None], level, given.angles),
        angle_sigma=np.where(fill[:, None], _SIGMA, given.angle_sigma),
        is_heading=given.is_heading | fill,
    )


def _in_front(
    given: GivenOrientations, frame: AdjustmentFrame, measured: pd.DataFrame, own: np.ndarray
) -> int:
    """Number of points of the own images that intersect in front of their cameras."""
    strip = given.only(own)
    inside = measured[measured["image"].isin(strip.image)]
    count = inside["point"].value_counts()
    names = tuple(sorted(count.index[count >= 2]))[:_TRIAL_POINTS]
    if not names:
        return 0
    camera: Ints = strip.camera
    rays, _ = image_point_observations(inside, strip.image, names, camera)
    block = block_of(frame, strip, names, np.zeros((len(names), 3)), AdjustmentSettings())
    return int(intersect(rays, block.approximate_state(), len(names)).usable.sum())
