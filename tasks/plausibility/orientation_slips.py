"""The common mistakes of delivered orientations: units, orders and references of angles, turned images.

Each is the reading of the input as it would have to be if the mistake had been made; whether it explains the
data is judged by the tie points, see `tasks.plausibility.orientations`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.observations.image_point import ImagePoints
from tasks.block.given_orientations import AngleOrder, GivenOrientations

Reading: TypeAlias = tuple[GivenOrientations, ImagePoints, AngleOrder, Floats]


@dataclass(frozen=True)
class Slip:
    """One common mistake.

    Attributes
    ----------
    looks_like : what it would be.
    remedy : what to do.
    corrected : the input as it should have been read: orientations, image points, the order of the
        angles, and a turn (3, 3) of the camera to be applied last.
    kind : slips of one kind are different ways to have made the same one; need not be told from each other.
    declare : key and value of the project file that would correct it, below `inputs`; empty: the file must
    be.
    """

    looks_like: str
    remedy: str
    corrected: Callable[[GivenOrientations, ImagePoints], Reading]
    kind: str = ""
    declare: str = ""


_SAME = np.eye(3)
#: The same words for either order that was declared.
OTHER_ORDER = "The angles look like the other order of ω and φ"


def usual_slips(given: GivenOrientations) -> list[Slip]:
    """The common mistakes."""
    on_grid = [] if given.is_heading.all() else _of_the_grid()
    by_north = _of_headings() if given.is_heading.any() else []
    return [*_of_units(), *_of_axes(), *_of_quarter_turns(given), *on_grid, *by_north]


def _of_units() -> list[Slip]:
    key = "angles.unit"
    return [
        _angles("The angles look like gon", f'Declare {key} = "gon" for the exposures.', 0.9),
        _angles("The angles look like degrees", f'Declare {key} = "deg" for the exposures.', 10.0 / 9.0),
        _angles("The angles look like radians", f'Declare {key} = "rad" for the exposures.', 180.0 / np.pi),
    ]


def _of_axes() -> list[Slip]:
    """Axes of the image mirrored or swapped, rotations transposed."""
    return [
        Slip(
            "The image coordinates look mirrored (y down)",
            "Image coordinates count y against the rows (up); change the sign of y, or declare unit px. Of "
            "film images check the side from which fiducials_mm numbers the marks.",
            lambda g, r: (g, replace(r, xy=r.xy * np.array([1.0, -1.0])), "omega-phi-kappa", _SAME),
        ),
        Slip(
            "The image coordinates look mirrored (x to the left)",
            "Image coordinates count x along the columns (to the right); change the sign of x. Of film "
            "images check the side from which fiducials_mm numbers the marks.",
            lambda g, r: (g, replace(r, xy=r.xy * np.array([-1.0, 1.0])), "omega-phi-kappa", _SAME),
        ),
        Slip(
            "The columns x and y of the image points look swapped",
            "Swap the two columns, or their names in the header.",
            lambda g, r: (g, replace(r, xy=r.xy[:, ::-1].copy()), "omega-phi-kappa", _SAME),
            declare='image_points.columns = { x = "y", y = "x" }',
        ),
        Slip(
            "The rotations look transposed (camera from ground instead of ground from camera)",
            "Export the angles of the rotation from the camera to the ground.",
            lambda g, r: (g, r, "omega-phi-kappa", _transposing(g)),
        ),
    ]


def _of_quarter_turns(given: GivenOrientations) -> list[Slip]:
    """Images, headings, or those of one of several cameras, turned by 90°, 180° or 270°."""
    slips = []
    for quarter in (1, 2, 3):
        turn = np.round(rotation.about_z(quarter * np.pi / 2.0))
        slips.append(
            Slip(
                f"The images look rotated by {90 * quarter}° relative to the given angles",
                "Check which way up the images were measured, κ, and mount_deg if headings are given; of "
                "film images where fiducials_mm begins to number the marks.",
                lambda g, r, turn=turn: (g, r, "omega-phi-kappa", turn),  # type: ignore[misc]
                f"turned by {90 * quarter}°",
            )
        )
        if given.is_heading.any():
            slips.append(_turned_headings(quarter))
        for camera in _several(given):
            slips += _turned_camera(given, camera, quarter)
    return slips


def _of_the_grid() -> list[Slip]:
    """Order, sign and reference of angles counted from the axes of the map."""
    return [
        Slip(
            OTHER_ORDER,
            'Declare angles.order = "phi-omega-kappa" instead of "omega-phi-kappa".',
            lambda g, r: (g, r, "phi-omega-kappa", _SAME),
            "order",
            declare='exposures.angles.order = "phi-omega-kappa"',
        ),
        Slip(
            OTHER_ORDER,
            'Declare angles.order = "omega-phi-kappa" instead of "phi-omega-kappa".',
            lambda g, r: (with_omega_first(g), r, "omega-phi-kappa", _SAME),
            "order",
            declare='exposures.angles.order = "omega-phi-kappa"',
        ),
        Slip(
            "κ appears to be counted clockwise",
            "Change the sign of κ in the exposures: it is counted counter-clockwise, from east to the x axis "
            "of the image.",
            lambda g, r: (_with_opposite_kappa(g), r, "omega-phi-kappa", _SAME),
        ),
        Slip(
            "The angles appear to refer to true north",
            'Declare angles.reference = "true-north" for the exposures.',
            lambda g, r: (replace(g, local_from_grid=g.local_from_enu), r, "omega-phi-kappa", _SAME),
            declare='exposures.angles.reference = "true-north"',
        ),
        Slip(
            "The angles appear to refer to grid north",
            'Declare angles.reference = "grid" for the exposures.',
            lambda g, r: (replace(g, local_from_grid=_once_more(g)), r, "omega-phi-kappa", _SAME),
            declare='exposures.angles.reference = "grid"',
        ),
    ]


def with_omega_first(given: GivenOrientations) -> GivenOrientations:
    """Angles that were read as φ, ω, κ, read as ω, φ, κ."""
    delivered = rotation.to_phi_omega_kappa(rotation.from_omega_phi_kappa(given.angles))
    return replace(given, angles=np.where(given.is_heading[:, None], given.angles, delivered))


def _with_opposite_kappa(given: GivenOrientations) -> GivenOrientations:
    opposite = given.angles * np.array([1.0, 1.0, -1.0])
    return replace(given, angles=np.where(given.is_heading[:, None], given.angles, opposite))


def _of_headings() -> list[Slip]:
    """Headings counted from the other north: they differ by the meridian convergence of each exposure."""
    return [
        Slip(
            f"The headings appear to refer to {words}",
            f'Declare angles.reference = "{reference}" for the exposures.',
            lambda g, r, sign=sign: (_from_other_north(g, sign), r, "omega-phi-kappa", _SAME),  # type: ignore[misc]
            declare=f'exposures.angles.reference = "{reference}"',
        )
        for words, reference, sign in (("true north", "true-north", 1.0), ("grid north", "grid", -1.0))
    ]


def _from_other_north(given: GivenOrientations, sign: float) -> GivenOrientations:
    enu_from_grid = np.swapaxes(given.local_from_enu, 1, 2) @ given.local_from_grid
    convergence = np.arctan2(enu_from_grid[:, 1, 0], enu_from_grid[:, 0, 0])
    angles = given.angles.copy()
    angles[:, 0] += sign * np.where(given.is_heading, convergence, 0.0)
    return replace(given, angles=angles)


def _turned_headings(quarter: int) -> Slip:
    """Headings off by quarter turns: unlike a turned camera, roll and pitch stay with the body's axes."""
    return Slip(
        f"The headings look rotated by {90 * quarter}°",
        "Check the definition of the headings (nose of the aircraft, clockwise from north) and mount_deg.",
        lambda g, r: (_with_turned_headings(g, quarter), r, "omega-phi-kappa", _SAME),
        f"turned by {90 * quarter}°",
    )


def _with_turned_headings(
    given: GivenOrientations, quarter: int, camera: int | None = None
) -> GivenOrientations:
    """Headings, of one camera only if it is named, turned clockwise by quarter turns."""
    turned = given.is_heading if camera is None else given.is_heading & (given.camera == camera)
    first = np.array([1.0, 0.0, 0.0])
    return replace(given, angles=given.angles + np.where(turned, quarter * np.pi / 2.0, 0.0)[:, None] * first)


def _several(given: GivenOrientations) -> list[int]:
    """The cameras that took images, if more than one did."""
    cameras = [int(camera) for camera in np.unique(given.camera)]
    return cameras if len(cameras) > 1 else []


def _turned_camera(given: GivenOrientations, camera: int, quarter: int) -> list[Slip]:
    """The images of one of several cameras, or their headings, turned by quarter turns."""
    turn = np.where(
        (given.camera == camera)[:, None, None], np.round(rotation.about_z(quarter * np.pi / 2.0)), _SAME
    )
    name = given.mountings.names[camera]
    looks_like = f"The images of camera {name} look rotated by {90 * quarter}° relative to the given angles"
    remedy = f"Check which way up its images were measured, their κ or headings, and mount_deg of {name}."
    kind = f"camera {camera} turned by {90 * quarter}°"
    slips = [Slip(looks_like, remedy, lambda g, r: (g, r, "omega-phi-kappa", turn), kind)]
    if given.is_heading.any():
        slips.append(
            Slip(
                looks_like,
                remedy,
                lambda g, r: (_with_turned_headings(g, quarter, camera), r, "omega-phi-kappa", _SAME),
                kind,
            )
        )
    return slips


def _once_more(given: GivenOrientations) -> Floats:
    """Axes (n, 3, 3) in which a meridian convergence that was added on import is taken away again."""
    enu_from_grid = np.swapaxes(given.local_from_enu, 1, 2) @ given.local_from_grid
    return np.asarray(given.local_from_grid @ enu_from_grid)


def _angles(looks_like: str, remedy: str, factor: float) -> Slip:
    return Slip(
        looks_like,
        remedy,
        lambda g, r: (replace(g, angles=g.angles * factor), r, "omega-phi-kappa", _SAME),
        declare=f"exposures.{remedy.removeprefix('Declare ').removesuffix(' for the exposures.')}",
    )


def _transposing(given: GivenOrientations) -> Floats:
    """Turns (n, 3, 3) that make of each rotation grid from camera its transpose."""
    _, local_from_camera = given.orientations()
    grid_from_camera = np.swapaxes(given.local_from_grid, 1, 2) @ local_from_camera
    transposed = np.swapaxes(grid_from_camera, 1, 2)
    return transposed @ transposed
