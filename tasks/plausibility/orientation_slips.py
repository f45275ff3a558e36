"""The common mistakes of delivered orientations: units, orders and references of angles, turned images.

Each is the reading of the input as it would have to be if the mistake had been made; whether it explains the
data is judged by the tie points, see `tasks.plausibility.orientations`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import starmap

import numpy as np

from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.observations.image_point import ImagePoints
from adjust.parameters import State
from tasks.block.given_orientations import AngleOrder, GivenOrientations

_SAME = np.eye(3)
#: The same words for either order that was declared.
OTHER_ORDER = "The angles look like the other order of ω and φ"


@dataclass(frozen=True, eq=False)
class Delivered:
    """Orientations and image points as they are read.

    Attributes
    ----------
    given, rays : exposures and image points, of all points or a sample.
    order : how ω, φ, κ are read.
    turn : (3, 3) or (n, 3, 3), applied to the cameras last.
    """

    given: GivenOrientations
    rays: ImagePoints
    order: AngleOrder = "omega-phi-kappa"
    turn: Floats = field(default_factory=lambda: _SAME)

    def state(self, state: State) -> State:
        """The state with these orientations."""
        centre, local_from_camera = self.given.orientations(self.order)
        return replace(state, projection_centre=centre, local_from_camera=local_from_camera @ self.turn)


@dataclass(frozen=True)
class Slip:
    """One common mistake.

    Attributes
    ----------
    looks_like : what it would be.
    remedy : what to do.
    corrected : the delivery as it should have been read.
    declare : the line of the project file that would correct it; empty: the files must be corrected.
    kind : slips of one kind are different ways to have made the same one; need not be told from each other.
    """

    looks_like: str
    remedy: str
    corrected: Callable[[Delivered], Delivered]
    declare: str = ""
    kind: str = ""


def of_given(
    looks_like: str,
    remedy: str,
    change: Callable[[GivenOrientations], GivenOrientations],
    declare: str = "",
    kind: str = "",
) -> Slip:
    """A slip of the exposures alone, which `change` undoes."""
    return Slip(looks_like, remedy, lambda d: replace(d, given=change(d.given)), declare, kind)


def _of_images(looks_like: str, remedy: str, change: Callable[[Floats], Floats], declare: str = "") -> Slip:
    return Slip(looks_like, remedy, lambda d: replace(d, rays=replace(d.rays, xy=change(d.rays.xy))), declare)


def _turned(looks_like: str, remedy: str, turn: Floats, kind: str) -> Slip:
    return Slip(looks_like, remedy, lambda d: replace(d, turn=d.turn @ turn), kind=kind)


#: Units of angles: in the project file, in words, and a factor: angles were read as degrees, degrees as gon.
UNITS = (("gon", "gon", 0.9), ("deg", "degrees", 10.0 / 9.0), ("rad", "radians", 180.0 / np.pi))


def other_unit(unit: str, words: str, factor: float) -> Slip:
    """Angles in another unit than declared, which a factor turns into it."""
    return of_given(
        f"The angles look like {words}",
        f'Declare angles.unit = "{unit}" for the exposures.',
        lambda g: replace(g, angles=g.angles * factor),
        f'inputs.exposures.angles.unit = "{unit}"',
    )


def other_order(order: AngleOrder, remedy: str) -> Slip:
    """ω, φ, κ declared as φ, ω, κ, which the import has turned into ω, φ, κ, or the reverse."""

    def corrected(delivered: Delivered) -> Delivered:
        if order == "phi-omega-kappa":
            return replace(delivered, order=order)
        return replace(delivered, given=_with_omega_first(delivered.given))

    return Slip(OTHER_ORDER, remedy, corrected, f'inputs.exposures.angles.order = "{order}"', "order")


def usual_slips(given: GivenOrientations) -> list[Slip]:
    """The common mistakes."""
    on_grid = [] if given.is_heading.all() else _of_the_grid()
    by_north = _of_headings() if given.is_heading.any() else []
    return [*starmap(other_unit, UNITS), *_of_axes(), *_of_quarter_turns(given), *on_grid, *by_north]


def _of_axes() -> list[Slip]:
    """Axes of the image mirrored or swapped, rotations transposed."""
    return [
        _of_images(
            "The image coordinates look mirrored (y down)",
            "Image coordinates count y against the rows (up); change the sign of y, or declare unit px. Of "
            "film images check the side from which fiducials_mm numbers the marks.",
            lambda xy: xy * np.array([1.0, -1.0]),
        ),
        _of_images(
            "The image coordinates look mirrored (x to the left)",
            "Image coordinates count x along the columns (to the right); change the sign of x. Of film "
            "images check the side from which fiducials_mm numbers the marks.",
            lambda xy: xy * np.array([-1.0, 1.0]),
        ),
        _of_images(
            "The columns x and y of the image points look swapped",
            "Swap the two columns, or their names in the header.",
            lambda xy: xy[:, ::-1].copy(),
            'inputs.image_points.columns = { x = "y", y = "x" }',
        ),
        Slip(
            "The rotations look transposed (camera from ground instead of ground from camera)",
            "Export the angles of the rotation from the camera to the ground.",
            lambda d: replace(d, turn=d.turn @ _transposing(d.given)),
        ),
    ]


def _of_quarter_turns(given: GivenOrientations) -> list[Slip]:
    """Images, headings, or those of one of several cameras, turned by 90°, 180° or 270°."""
    slips = []
    for quarter in (1, 2, 3):
        turn = np.round(rotation.about_z(quarter * np.pi / 2.0))
        slips.append(
            _turned(
                f"The images look rotated by {90 * quarter}° relative to the given angles",
                "Check which way up the images were measured, κ, and mount_deg if headings are given; of "
                "film images where fiducials_mm begins to number the marks.",
                turn,
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
        other_order(
            "phi-omega-kappa", 'Declare angles.order = "phi-omega-kappa" instead of "omega-phi-kappa".'
        ),
        other_order(
            "omega-phi-kappa", 'Declare angles.order = "omega-phi-kappa" instead of "phi-omega-kappa".'
        ),
        of_given(
            "κ appears to be counted clockwise",
            "Change the sign of κ in the exposures: it is counted counter-clockwise, from east to the x axis "
            "of the image.",
            _with_opposite_kappa,
        ),
        of_given(
            "The angles appear to refer to true north",
            'Declare angles.reference = "true-north" for the exposures.',
            lambda g: replace(g, local_from_grid=g.local_from_enu),
            'inputs.exposures.angles.reference = "true-north"',
        ),
        of_given(
            "The angles appear to refer to grid north",
            'Declare angles.reference = "grid" for the exposures.',
            lambda g: replace(g, local_from_grid=_once_more(g)),
            'inputs.exposures.angles.reference = "grid"',
        ),
    ]


def _with_omega_first(given: GivenOrientations) -> GivenOrientations:
    """Angles that were read as φ, ω, κ, read as ω, φ, κ."""
    delivered = rotation.to_phi_omega_kappa(rotation.from_omega_phi_kappa(given.angles))
    return replace(given, angles=np.where(given.is_heading[:, None], given.angles, delivered))


def _with_opposite_kappa(given: GivenOrientations) -> GivenOrientations:
    opposite = given.angles * np.array([1.0, 1.0, -1.0])
    return replace(given, angles=np.where(given.is_heading[:, None], given.angles, opposite))


def _of_headings() -> list[Slip]:
    """Headings counted from the other north: they differ by the meridian convergence of each exposure."""
    return [
        of_given(
            f"The headings appear to refer to {words}",
            f'Declare angles.reference = "{reference}" for the exposures.',
            partial(_from_other_north, sign=sign),
            f'inputs.exposures.angles.reference = "{reference}"',
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
    return of_given(
        f"The headings look rotated by {90 * quarter}°",
        "Check the definition of the headings (nose of the aircraft, clockwise from north) and mount_deg.",
        lambda g: _with_turned_headings(g, quarter),
        kind=f"turned by {90 * quarter}°",
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
    slips = [_turned(looks_like, remedy, turn, kind)]
    if given.is_heading.any():
        slips.append(
            of_given(looks_like, remedy, lambda g: _with_turned_headings(g, quarter, camera), kind=kind)
        )
    return slips


def _once_more(given: GivenOrientations) -> Floats:
    """Axes (n, 3, 3) in which a meridian convergence that was added on import is taken away again."""
    enu_from_grid = np.swapaxes(given.local_from_enu, 1, 2) @ given.local_from_grid
    return np.asarray(given.local_from_grid @ enu_from_grid)


def _transposing(given: GivenOrientations) -> Floats:
    """Turns (n, 3, 3) that make of each rotation grid from camera its transpose."""
    _, local_from_camera = given.orientations()
    grid_from_camera = np.swapaxes(given.local_from_grid, 1, 2) @ local_from_camera
    transposed = np.swapaxes(grid_from_camera, 1, 2)
    return transposed @ transposed
