"""The block of the virtual images of a platform: one image for each event, composed of its heads' images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from adjust.camera.virtual_image import composed
from tasks.block.exposure_events import joined_images
from tasks.calibration.platform import AdjustedPlatform
from tasks.tables.places import places_of


@dataclass(frozen=True, eq=False)
class VirtualBlock:
    """Deliveries of the virtual images.

    Attributes
    ----------
    exposures, image_points : the tables of these names.
    doubled : image points that a second head measured in the same event, and that are left out.
    outside : image points outside the format of the virtual image.
    """

    exposures: pd.DataFrame
    image_points: pd.DataFrame
    doubled: int
    outside: int


def virtual_block(
    platform: AdjustedPlatform, exposures: pd.DataFrame, cameras: pd.DataFrame, image_points: pd.DataFrame
) -> VirtualBlock:
    """Compose the images of a calibrated platform for its mean height above ground.

    A point that several heads measure in one event is taken from the head in whose image it is the least far
    out. Its σ are those in the head, propagated to the axes of the virtual image.
    """
    taken = exposures[exposures["camera"].isin(platform.head)].reset_index(drop=True)
    event = _events(taken)
    first = np.unique(event, return_index=True)[1]
    virtual = _exposures(platform, taken.iloc[first].reset_index(drop=True), cameras)
    image = places_of(image_points["image"], taken["image"])
    measured = image_points[image >= 0].reset_index(drop=True)
    image = image[image >= 0]
    head = places_of(taken["camera"], platform.head)[image]
    xy = measured[["x_mm", "y_mm"]].to_numpy(np.float64) * 1e-3
    kept = _least_far_out(platform, event[image], measured["point"], head, xy)
    found = composed(platform.adjusted, head[kept], xy[kept], platform.distance)
    variance = measured[["sigma_x_mm", "sigma_y_mm"]].to_numpy(np.float64)[kept] ** 2
    sigma = np.sqrt(np.einsum("nij,nj->ni", found.of_point**2, variance))
    inside = (np.abs(found.xy) <= platform.half_format).all(axis=1)
    rows = kept[inside]
    table = pd.DataFrame(
        {
            "image": virtual["image"].to_numpy()[event[image[rows]]],
            "point": measured["point"].to_numpy()[rows],
            "x_mm": found.xy[inside, 0] * 1e3,
            "y_mm": found.xy[inside, 1] * 1e3,
            "sigma_x_mm": sigma[inside, 0],
            "sigma_y_mm": sigma[inside, 1],
            "input_file": measured["input_file"].to_numpy()[rows],
        }
    )
    return VirtualBlock(virtual, table, len(xy) - len(kept), len(kept) - len(rows))


def _events(taken: pd.DataFrame) -> Ints:
    """Number of the event of each image (n,), in the order of the images."""
    flight = pd.factorize(taken["flight"].fillna(""))[0].astype(np.int64)
    name = taken["event"].fillna("").to_numpy(dtype=np.str_)
    of_one_rig = np.zeros(len(taken), dtype=np.int64)
    time = taken["time_s"].to_numpy(np.float64)
    joined = joined_images(time, flight, name, of_one_rig, np.ones(len(taken), dtype=bool))
    return pd.factorize(joined)[0].astype(np.int64)


def _exposures(platform: AdjustedPlatform, first: pd.DataFrame, cameras: pd.DataFrame) -> pd.DataFrame:
    """An exposure for each event: the readings of its first image, with angles of the virtual image.

    κ belongs to the nominal mounting of a camera; heading, pitch and roll belong to the body.
    """
    mount = cameras.set_index("camera")["mount_deg"]
    turn = float(mount[platform.name]) - first["camera"].map(mount).to_numpy(np.float64)
    kappa = first["kappa_deg"].to_numpy(np.float64) + turn
    named = first["event"].fillna("")
    return first.assign(
        image=np.where(named == "", first["image"], named),
        camera=platform.name,
        kappa_deg=(kappa + 180.0) % 360.0 - 180.0,
    )


def _least_far_out(platform: AdjustedPlatform, event: Ints, point: pd.Series, head: Ints, xy: Floats) -> Ints:
    """Rows (k,) of the image points, one for each event and point."""
    out = (np.abs(xy) / platform.adjusted.half_format[head]).max(axis=1)
    order = np.lexsort((out, pd.factorize(point)[0], event))
    again = pd.DataFrame({"event": event[order], "point": point.to_numpy()[order]}).duplicated()
    return np.asarray(np.sort(order[~again.to_numpy()]))
