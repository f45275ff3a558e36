"""Orientations as a table with a header: image, camera, X, Y, Z, three angles, their covariance.

Standard deviations of all, and correlations, with which the covariance of an orientation is complete; empty
where they are not known.
"""

from __future__ import annotations

from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.numbers import DECIMALS, METRES, known, orientations, table

_OF_POSITION = ("correlation_x_y", "correlation_x_z", "correlation_y_z")
# Of a correlation; it makes covariances to 1e-6 of the variances.
_CORRELATION = 6


def write_eo_csv(delivery: Delivery) -> Files:
    """``eo.csv``; covariances of angles only in the system of the adjustment, ω, φ, κ."""
    angles, cells = delivery.angles, orientations(delivery, delivery.angles)
    names = [f"{name}_{angles.unit}" for name in angles.order.split("-")]
    sigmas = delivery.sigmas
    correlations = delivery.correlations
    if angles.order == "omega-phi-kappa":
        shown, together = list(sigmas.columns), list(correlations.columns)
    else:
        shown = list(sigmas.columns[:3])
        together = [name for name in correlations.columns if name in _OF_POSITION]
    factor = {"deg": 1.0, "gon": 200.0 / 180.0, "rad": 3.141592653589793 / 180.0}[angles.unit]
    header = [name.replace("_deg", f"_{angles.unit}") for name in shown]
    rows = []
    for k, image in enumerate(delivery.names):
        sigma = [float(sigmas[name].iloc[k]) * (factor if name.endswith("_deg") else 1.0) for name in shown]
        rows.append(
            [
                image,
                delivery.camera_names[k],
                *cells[k],
                *known(sigma[:3], METRES),
                *known(sigma[3:], DECIMALS[angles.unit]),
                *known((float(correlations[name].iloc[k]) for name in together), _CORRELATION),
            ]
        )
    return {"eo.csv": table(["image", "camera", "x_m", "y_m", "z_m", *names, *header, *together], rows)}
