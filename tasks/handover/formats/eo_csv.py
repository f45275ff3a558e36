"""Orientations as a table with a header: image, camera, X, Y, Z, three angles, standard deviations."""

from __future__ import annotations

from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.numbers import ANGLES, METRES, fixed, in_angles, table

_DECIMALS = {"deg": ANGLES, "gon": ANGLES, "rad": ANGLES + 2}


def write_eo_csv(delivery: Delivery) -> Files:
    """``eo.csv``; standard deviations of angles only in the system they are known in, ω, φ, κ."""
    angles, pose = delivery.angles, delivery.handed.pose
    names = [f"{name}_{angles.unit}" for name in angles.order.split("-")]
    sigmas = delivery.sigmas
    known = list(sigmas.columns) if angles.order == "omega-phi-kappa" else list(sigmas.columns[:3])
    factor = {"deg": 1.0, "gon": 200.0 / 180.0, "rad": 3.141592653589793 / 180.0}[angles.unit]
    header = [name.replace("_deg", f"_{angles.unit}") for name in known]
    rows = []
    for k, image in enumerate(delivery.names):
        sigma = [float(sigmas[name].iloc[k]) * (factor if name.endswith("_deg") else 1.0) for name in known]
        rows.append(
            [
                image,
                delivery.camera_names[k],
                *fixed(pose.centre[k], METRES),
                *fixed(in_angles(pose.map_from_camera[k : k + 1], angles)[0], _DECIMALS[angles.unit]),
                *fixed(sigma[:3], METRES),
                *fixed(sigma[3:], _DECIMALS[angles.unit]),
            ]
        )
    return {"eo.csv": table(["image", "camera", "x_m", "y_m", "z_m", *names, *header], rows)}
