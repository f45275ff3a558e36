"""True orientations of a block that another program adjusted with map coordinates taken as Cartesian.

Such orientations are not positions of the camera: to fit a world whose scale and curvature are wrong, heights
move by decimetres to metres. What the program is right about is where its image points are on the ground. So
a grid of image points of every image is projected to the ground by its own model, at three heights, and the
true orientation is the one that sees these ground points through the curved earth (the other direction is
`tasks.handover.receiver`). What is left is the error of its model, which the program cannot have seen.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pyarrow as pa

from adjust.arrays import Floats
from adjust.camera.interior import FrameCamera
from adjust.geometry.rotation import (
    from_omega_phi_kappa,
    from_phi_omega_kappa,
    to_omega_phi_kappa,
    to_phi_omega_kappa,
)
from adjust.handover.cartesian_map import EARTH_RADIUS_M, CartesianMap, Pose, on_ground
from adjust.handover.refit import Freed, refit
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_frame, local_from_grid, local_from_map, map_from_local
from tasks.deliveries.exposure_angles import RADIANS_PER_UNIT
from tasks.errors import Location
from tasks.formats.records import ExposureRecords
from tasks.settings.inputs import ExposuresInput

# Points along each side of the format, and how far heights reach from the middle, in flying heights: over one
# height alone, a focal length and the height of a camera cannot be separated.
_SIDE, _SPREAD = 9, 0.05
#: Vertical images 4 km above ground leave 2 pixels; of more, something else was declared wrong.
REFUSED_PX = 10.0


def true_orientations(
    records: ExposureRecords,
    source: ExposuresInput,
    frame: MapFrame,
    camera: pa.Array,
    cameras: Mapping[str, FrameCamera],
) -> ExposureRecords:
    """The records with the positions and angles that the images had, where the input declares `adjusted_in`.

    Parameters
    ----------
    frame : CRS and heights of the input, a map projection.
    camera : name of the camera of each row.
    cameras : by name, as the project declares them.

    Raises
    ------
    InputError
        If the CRS is not a map projection, an exposure is not above the ground, or what the program saw can
        be seen by no true orientation.
    """
    declared = source.adjusted_in
    if declared is None:
        return records
    if not frame.is_projected:
        raise Location(source.file).error(
            f"The orientations cannot have been adjusted in {source.crs}, which is not a map projection.",
            "Declare the CRS in which they were adjusted, or leave adjusted_in out.",
        )
    rows = np.flatnonzero(np.isfinite(np.hstack([records.position, records.angles])).all(axis=1))
    if len(rows) == 0:
        return records
    frames = [cameras[str(camera[int(row)])] for row in rows]
    pose = _delivered(records, source, rows, np.array([one.focal_length for one in frames]))
    above = pose.centre[:, 2] - declared.ground_m
    if (above <= 0.0).any():
        row = int(rows[int(np.argmin(above))])
        raise Location(source.file, int(records.line[row]), str(records.image[row])).error(
            f"The exposure is {-above.min():,.1f} m below the ground (adjusted_in.ground_m).",
            "Declare the mean height of the ground in the heights of this input.",
        )
    ideal, height = _samples(frames, above, declared.ground_m)
    world = CartesianMap(EARTH_RADIUS_M if declared.world == "map-cartesian-curved" else None)
    seen = on_ground(world, pose, ideal, height)
    found, misfit = _fitted(pose, ideal, seen, frame)
    in_pixels = misfit / np.array([one.pixel_size for one in frames])
    worst = int(np.argmax(in_pixels))
    if in_pixels[worst] >= REFUSED_PX:
        raise Location(
            source.file, int(records.line[rows[worst]]), str(records.image[int(rows[worst])])
        ).error(
            f"No rigorous orientation reproduces the image points of this one: {in_pixels[worst]:.0f} "
            "pixels differ.",
            "Check the camera, the CRS and adjusted_in.ground_m.",
        )
    position, angles = records.position.copy(), records.angles.copy()
    position[rows], angles[rows] = found.centre, _angles(found.map_from_camera, source)
    remark = _remark(found.centre - pose.centre, float(in_pixels[worst]), declared.world)
    remark = f"{source.file.name}: {remark}"
    return replace(records, position=position, angles=angles, remarks=(*records.remarks, remark))


def _remark(moved: Floats, left_px: float, world: str) -> str:
    """What was done to orientations that moved by (n, 3) metres."""
    plan = np.linalg.norm(moved[:, :2], axis=1).max()
    return (
        f"{len(moved):,} orientations that were adjusted in map coordinates ({world}) are converted to "
        f"rigorous ones: heights change by {moved[:, 2].min():+z.2f} to {moved[:, 2].max():+z.2f} m, "
        f"horizontal positions by up to {plan:.2f} m; {left_px:.2f} pixels of error of that program's "
        "model remain."
    )


def _delivered(
    records: ExposureRecords, source: ExposuresInput, rows: np.typing.NDArray[np.int64], focal_length: Floats
) -> Pose:
    """The orientations of some rows (n,) as that program has them."""
    angles = records.angles[rows] * RADIANS_PER_UNIT[source.angles.unit]
    phi_first = source.angles.order == "phi-omega-kappa"
    turn = from_phi_omega_kappa(angles) if phi_first else from_omega_phi_kappa(angles)
    return Pose(records.position[rows], turn, focal_length, np.zeros(len(rows)))


def _angles(turn: Floats, source: ExposuresInput) -> Floats:
    phi_first = source.angles.order == "phi-omega-kappa"
    angles = to_phi_omega_kappa(turn) if phi_first else to_omega_phi_kappa(turn)
    return np.asarray(angles / RADIANS_PER_UNIT[source.angles.unit])


def _samples(frames: list[FrameCamera], above: Floats, ground: float) -> tuple[Floats, Floats]:
    """Image points (n, 3 k, 2), metres from the principal point, and heights (n, 3 k)."""
    steps = np.linspace(-1.0, 1.0, _SIDE)
    unit = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    half = np.array([one.half_format for one in frames])
    levels = ground + above[:, None] * np.array([-_SPREAD, 0.0, _SPREAD])
    return np.tile(unit * half[:, None], (1, 3, 1)), np.repeat(levels, len(unit), axis=1)


def _fitted(pose: Pose, ideal: Floats, seen: Floats, frame: MapFrame) -> tuple[Pose, Floats]:
    """True orientations in the map that see ground points (n, k, 3), and the misfits (n,), metres."""
    place = local_frame(frame, pose.centre)
    axes = local_from_grid(frame, place, pose.centre)
    start = Pose(
        local_from_map(frame, place, pose.centre),
        axes @ pose.map_from_camera,
        pose.focal_length,
        pose.radial,
    )
    ground = local_from_map(frame, place, seen.reshape(-1, 3)).reshape(seen.shape)
    one_camera = np.zeros(len(pose.centre), dtype=np.int64)
    # Nothing of the cameras is fitted, so it does not matter which image has which.
    fitted = refit(CartesianMap(), start, one_camera, ideal, ground, Freed())
    centre = map_from_local(frame, place, fitted.pose.centre)
    turned = np.swapaxes(local_from_grid(frame, place, centre), 1, 2) @ fitted.pose.map_from_camera
    return Pose(centre, turned, pose.focal_length, pose.radial), fitted.largest
