"""ImageStation (ISAT): the files ``photo`` and ``camera``, ω, φ, κ in degrees, and distortion grids."""

from __future__ import annotations

from tasks.handover.delivery import Angles, Delivery, Files
from tasks.handover.formats.grid_text import gridgroups
from tasks.handover.formats.numbers import ANGLES, METRES, fixed, in_angles
from tasks.handover.results import CalibratedCamera


def write_isat(delivery: Delivery) -> Files:
    """``photo``, ``camera``, grids of cameras with corrections; standard deviations of the adjustment."""
    pose = delivery.handed.pose
    angles = in_angles(pose.map_from_camera, Angles())
    sigmas = delivery.sigmas.to_numpy(float)
    photos = []
    for k, name in enumerate(delivery.names):
        photos += [
            f"begin photo_parameters {_word(name)} strip_id {_word(delivery.results.strips[k]) or 1}",
            f" camera_name: {_word(delivery.camera_names[k])}",
            f" image_id: {name}",
            f" EO_parameters: {' '.join([*fixed(pose.centre[k], METRES), *fixed(angles[k], ANGLES)])}",
            f" COMPUTED_std_devs: {' '.join([*fixed(sigmas[k, :3], METRES), *fixed(sigmas[k, 3:], ANGLES)])}",
            "end photo_parameters",
        ]
    focal = dict(zip(delivery.camera_names, pose.focal_length, strict=True))
    cameras = [
        line for item in delivery.results.cameras for line in _camera(item, float(focal[item.frame.name]))
    ]
    return {"photo": "\n".join(photos) + "\n", "camera": "\n".join(cameras) + "\n", **gridgroups(delivery)}


def _camera(camera: CalibratedCamera, focal_length: float) -> list[str]:
    frame = camera.frame
    x0, y0 = fixed([1e3 * value for value in frame.principal_point], 6)
    return [
        f"begin camera_parameters {_word(frame.name)}",
        f" focal_length: {1e3 * focal_length:.6f}",
        f" ppac: {x0} {y0}",
        f" pixel_size: {1e6 * frame.pixel_size:.6f}",
        f" image_size_in_pixels: {frame.columns} {frame.rows}",
        " camera_type: frame",
        " media_type: digital",
        " lens_distortion_flag: off",
        "end camera_parameters",
    ]


def _word(name: str) -> str:
    """A name without blanks, at which its names end."""
    return name.replace(" ", "_")
