"""Catalyst OrthoEngine: exterior orientations as text, image X Y Z ω φ κ, degrees; its heights are ellipsoidal or above sea level as declared there."""  # noqa: E501

from __future__ import annotations

from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.grid_text import gridgroups
from tasks.handover.formats.numbers import orientations
from tasks.handover.formats.short_names import renamed, without_blanks


def write_catalyst(delivery: Delivery) -> Files:
    """``catalyst_eo.txt``, and the grids of cameras with corrections."""
    names = without_blanks(delivery.names)
    lines = [" ".join([name, *cells]) for name, cells in zip(names, orientations(delivery), strict=True)]
    return {
        "catalyst_eo.txt": "\n".join(lines) + "\n",
        **gridgroups(delivery),
        **renamed("catalyst_images.csv", "image", names, delivery.names),
    }
