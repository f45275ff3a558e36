"""How kinds of programs represent the world, and what each is given.

The kind is a property of the program, not of the file format: the same PATB file is right for one program and
wrong by decimetres for another.

* ``local``: its world is Cartesian and we choose it: the frame east, north, up in the middle of the block.
  Nothing is approximated.
* ``map``: it knows the map projection and computes with the curved earth: true positions in the map, angles
  from grid north.
* ``map-cartesian``: it takes map coordinates as Cartesian: orientations, and where it takes our camera one
  focal length and one radial term for each camera, are refitted to its model.
* ``map-cartesian-curved``: the same, and it corrects the curvature of the earth itself.
* ``rpc``: it takes rational polynomials in place of a camera, from latitude, longitude and ellipsoidal
  height of WGS 84.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats
from adjust.handover.cartesian_map import EARTH_RADIUS_M, CartesianMap, Pose, on_ground
from adjust.handover.rational import RationalPolynomials, fit_rational_polynomials
from adjust.handover.refit import Freed, refit
from tasks.coordinates.wgs84 import geodetic_on_wgs84
from tasks.errors import InputError
from tasks.handover.results import Results
from tasks.settings.deliver import World

#: Misfit of a program's model that is said, and one that is refused, pixels.
WARNED_PX, REFUSED_PX = 0.5, 1.0
# Side of the grid of image points of a fit; how far heights are spread at least, part of the flying height.
_SIDE, _LEAST_SPREAD = 9, 0.05
# The same of a fit of rational polynomials, which have more terms, and number of its heights.
_SIDE_OF_POLYNOMIALS, _SPREAD_OF_POLYNOMIALS, _LEVELS_OF_POLYNOMIALS = 15, 0.1, 5


@dataclass(frozen=True, eq=False)
class HandedOver:
    """Orientations for one kind of program.

    Attributes
    ----------
    world : the kind.
    pose : positions, rotations world from camera, focal lengths, radial terms.
    misfit_px : (n,) largest difference in the image between its model and ours.
    misfit_m : (n,) the same on the ground, in plan.
    refitted : whether the positions are fitted, and no positions of the camera any more.
    polynomials : of each image, in the world of these.
    """

    world: World
    pose: Pose
    misfit_px: Floats
    misfit_m: Floats
    refitted: bool
    polynomials: tuple[RationalPolynomials, ...] = ()


def hand_over(results: Results, world: World, freed: Freed) -> HandedOver:
    """The orientations of a block for a kind of program.

    Parameters
    ----------
    freed : what a program that takes the map as Cartesian lets us change of the camera.

    Raises
    ------
    InputError
        If the block has no location on the earth and the kind needs one.
    """
    images = results.images
    n = len(images.names)
    nothing = np.zeros(n)
    if world == "local":
        pose = Pose(images.projection_centre, images.local_from_camera, *_camera(results))
        return HandedOver(world, pose, nothing, nothing, refitted=False)
    if images.map_frame.is_local:
        if world == "rpc":
            raise InputError(
                "Rational polynomials require latitude and longitude, but the block is local.",
                "Write it for a Cartesian world (--world local).",
                entity="project.crs",
            )
        return HandedOver(world, images.map_pose, nothing, nothing, refitted=False)
    if world == "rpc":
        return _polynomials(results)
    if not images.map_frame.is_projected:
        raise InputError(
            "The results are in latitude and longitude, which such programs do not support.",
            "Adjust in a projected CRS, or write for a Cartesian world (--world local).",
            entity="project.crs",
        )
    if world == "map":
        return HandedOver(world, images.map_pose, nothing, nothing, refitted=False)
    model = CartesianMap(EARTH_RADIUS_M if world == "map-cartesian-curved" else None)
    ideal, height = _samples(results)
    ground = images.ground(ideal, height)
    fitted = refit(model, images.map_pose, images.camera, ideal, ground, freed)
    away = on_ground(model, fitted.pose, ideal, height)[..., :2] - ground[..., :2]
    return HandedOver(
        world,
        fitted.pose,
        fitted.largest / images.pixel_size[images.camera],
        np.linalg.norm(away, axis=-1).max(axis=1),
        refitted=True,
    )


def _polynomials(results: Results) -> HandedOver:
    """Rational polynomials of measured pixels; they contain the whole model of camera and earth."""
    images = results.images
    fitted, misfit = [], []
    for index, number in enumerate(images.camera):
        camera, one = results.cameras[number], images.only(index)
        low, middle, high = results.ground[index]
        spread = _SPREAD_OF_POLYNOMIALS * (one.map_pose.centre[0, 2] - middle)
        heights = np.linspace(min(low, middle - spread), max(high, middle + spread), _LEVELS_OF_POLYNOMIALS)
        at = one.grid_of_image_points(_SIDE_OF_POLYNOMIALS)[0]
        seen = one.ground(
            np.tile(camera.ideal(at), (len(heights), 1))[None], np.repeat(heights, len(at))[None]
        )
        geodetic = geodetic_on_wgs84(images.map_frame, seen[0])
        geodetic[:, :2] = np.rad2deg(geodetic[:, :2])
        # Across the antimeridian they are counted on.
        geodetic[:, 1] -= 360.0 * np.round((geodetic[:, 1] - geodetic[0, 1]) / 360.0)
        pixel = replace(camera.frame, pixel_origin="centre").pixel_from_image(at)[:, ::-1]
        pixel = np.tile(pixel, (len(heights), 1))
        fitted.append(fit_rational_polynomials(geodetic, pixel))
        misfit.append(np.linalg.norm(fitted[-1].project(geodetic) - pixel, axis=1).max())
    in_pixels = np.array(misfit)
    above = images.map_pose.centre[:, 2] - results.ground[:, 1]
    pixel_m = images.pixel_size[images.camera] / images.focal_length[images.camera] * above
    return HandedOver(
        "rpc", images.map_pose, in_pixels, in_pixels * pixel_m, refitted=False, polynomials=tuple(fitted)
    )


def _camera(results: Results) -> tuple[Floats, Floats]:
    camera = results.images.camera
    return results.images.focal_length[camera], np.zeros(len(camera))


def _samples(results: Results) -> tuple[Floats, Floats]:
    """Image points (n, 3 k, 2) and heights (n, 3 k): low, middle and high ground under each image."""
    images = results.images
    low, middle, high = results.ground.T
    above = images.map_pose.centre[:, 2] - middle
    spread = _LEAST_SPREAD * above
    levels = np.stack([np.minimum(low, middle - spread), middle, np.maximum(high, middle + spread)], axis=1)
    grid = images.grid_of_image_points(_SIDE)
    return np.tile(grid, (1, 3, 1)), np.repeat(levels, grid.shape[1], axis=1)
