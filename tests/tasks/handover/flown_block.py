"""Four oriented images whose image points are exact, through the curved earth and the atmosphere."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from functools import cache, lru_cache

import numpy as np
import pandas as pd

from adjust.camera.interior import FrameCamera
from adjust.geometry.earth import TopocentricFrame
from adjust.geometry.rotation import about_x, about_z, from_omega_phi_kappa
from tasks.block.self_calibration import additional_parameters_of, image_format_of
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_from_map
from tasks.handover.block_points import BlockPoints, SurveyedPoints
from tasks.handover.delivery import Delivery
from tasks.handover.distortion_grid import distortion_grids
from tasks.handover.export import lenses_of
from tasks.handover.formats.register import REGISTER
from tasks.handover.lens import Lenses
from tasks.handover.on_wgs84 import block_on_wgs84
from tasks.handover.receiver import Freed, World, hand_over
from tasks.handover.results import CalibratedCamera, Results
from tasks.handover.rig_heads import RigHeads
from tasks.handover.rigorous import OrientedImages
from tasks.settings.coordinates import Heights

GROUND = 400.0
UTM = MapFrame.of("EPSG:25832", Heights.model_validate("ellipsoidal"))
LOCAL = MapFrame.of("local", Heights.model_validate("ellipsoidal"))
NAMES = ("1 a.tif", "0002.tif", "III_3", "4")


@dataclass(frozen=True)
class Flight:
    """A case: height above ground, tilt, refraction, correction polynomials (else a forward distortion).

    `binned` pixels of the camera are one, so that an image of it can be made. `rig`: the second camera is
    a head beside the first one, and two images each are of one event. `crs`: of the project.
    """

    above: float = 1000.0
    tilt_deg: float = 0.0
    refracted: bool = False
    corrections: bool = False
    longitude_deg: float = 9.3
    binned: int = 1
    rig: bool = False
    crs: str = "EPSG:25832"


#: The head of a rig against its reference head: image axes of both, metres.
HEAD = from_omega_phi_kappa(np.radians([20.0, -2.0, 91.0]))
BESIDE = np.array([0.2, -0.1, 0.05])


@cache
def flown(case: Flight) -> tuple[Results, BlockPoints]:
    """The block; each object point is seen in one image, where it was measured. Tests share it."""
    latitude, longitude = np.deg2rad([48.0, case.longitude_deg])
    place = MapFrame.of(case.crs, Heights.model_validate("ellipsoidal"))
    frame = TopocentricFrame(place.ellipsoid, float(latitude), float(longitude))
    east = place.from_geodetic(np.array([[latitude, longitude, GROUND + case.above]]))
    steps = np.arange(len(NAMES))[:, None] * 0.3 * case.above
    centre = local_from_map(place, frame, east + steps * [1.0, 0.2, 0.0])
    # An oblique camera looks to the same side of its image in every image.
    turn = about_z(np.array([0.0, np.pi, 1.2, -0.4])) @ about_x(np.deg2rad(case.tilt_deg))
    cameras = tuple(camera(name, case.tilt_deg != 0, case.binned, case.corrections) for name in ("UC A", "B"))
    turn = np.asarray(frame.local_from_enu(centre)) @ turn
    heads = None
    if case.rig:
        turn[1::2], centre[1::2] = turn[::2] @ HEAD, centre[::2] + turn[::2] @ BESIDE
        heads = RigHeads(np.array([0, 0]), np.array([0, 0, 1, 1]))
    images = OrientedImages(
        NAMES, np.array([0, 1, 0, 1]), place, frame, centre, turn,
        np.array([item.frame.focal_length for item in cameras]),
        np.array([item.frame.half_format for item in cameras]),
        np.array([item.frame.pixel_size for item in cameras]), case.refracted,
    )  # fmt: skip
    rng = np.random.default_rng(17)
    quantities = ("x_m", "y_m", "z_m", "omega_deg", "phi_deg", "kappa_deg")
    table = pd.DataFrame({f"sigma_{name}": rng.uniform(0.001, 0.1, len(NAMES)) for name in quantities})
    relief = 0.02 * case.above
    ground = np.tile([GROUND - relief, GROUND, GROUND + relief], (len(NAMES), 1))
    results = Results(
        images, cameras, table, ("s1", "s1", "s 2", ""), ground, "flown", date(2026, 5, 24), heads
    )  # fmt: skip
    return results, points_of(results)


@cache
def camera(name: str, oblique: bool, binned: int, corrections: bool) -> CalibratedCamera:
    """A large camera for vertical, a smaller one for oblique images; with distortion. Flights share it."""
    columns, rows, pixel, c = (14144, 10560, 3.76e-6, 0.123) if oblique else (17004, 26460, 4e-6, 0.0798)
    columns, rows, pixel = columns // binned, rows // binned, pixel * binned
    frame = FrameCamera(name, columns, rows, pixel, c, (12e-6, -20e-6), "corner", 0)
    row: dict[object, object] = {
        "columns": columns, "rows": rows, "pixel_um": pixel * 1e6, "focal_length_mm": c * 1e3, "tiles": None,
    }  # fmt: skip
    if corrections:
        # Some 50 µm at the corner; 1/m² and 1/m.
        known = {"brown:K1": 0.2, "brown:P1": 1e-4, "brown:P2": -5e-5}
    else:
        known = {"brown-forward:k1": -0.02, "brown-forward:k2": 0.004, "brown-forward:p1": 2e-4}
    additional = additional_parameters_of(name, "+".join(known), image_format_of(row, 0), 0)
    return CalibratedCamera(frame, additional, np.array([known[key] for key in additional.names]))


def points_of(results: Results) -> BlockPoints:
    """25 points of every image at three heights each."""
    images, image, xy, in_map = results.images, [], [], []
    for k, number in enumerate(images.camera):
        measured = np.tile(0.95 * images.only(k).grid_of_image_points(5)[0], (3, 1))
        height = np.repeat(results.ground[k], 25)
        ideal = results.cameras[number].corrected(measured)
        in_map.append(images.only(k).ground(ideal[None], height[None])[0])
        image.append(np.full(75, k))
        xy.append(measured)
    places = np.concatenate(in_map)
    names = tuple(f"P {k}" if k == 3 else f"P{k}" for k in range(len(places)))
    local = local_from_map(images.map_frame, images.frame, places)
    point = np.arange(len(places))
    chosen = np.array([3, 80, 160])
    given = places[chosen] - [0.02, -0.01, 0.03]
    given[2, 2] = np.nan
    known = np.full((3, 3), np.nan)
    known[:2] = local_from_map(images.map_frame, images.frame, given[:2])
    surveyed = SurveyedPoints(
        tuple(names[k] for k in chosen), given, known, np.full((3, 3), 0.02), np.array([False, True, False]),
        places[chosen] - given,
    )  # fmt: skip
    sigma = np.full((len(names), 3), 0.05)
    return BlockPoints(
        names,
        places,
        local,
        sigma,
        np.concatenate(image),
        point,
        np.concatenate(xy),
        np.full((len(point), 2), 1e-6),
        surveyed,
    )


def delivered(results: Results, points: BlockPoints, name: str) -> Delivery:
    """As `export_results` has it written."""
    form = REGISTER[name]
    handed = _handed_over(results, form.world, form.freed)
    lenses = _lenses(results, form.world, form.freed, form.lens) if form.lens else Lenses((), np.zeros(0))
    grids = tuple(map(_grids, results.cameras)) if form.grid else ()
    delivery = Delivery(results, handed, lenses=lenses, points=points, grids=grids)
    return block_on_wgs84(delivery) if form.on_wgs84 else delivery


# What many formats have in common; a block or a camera is the same only if it is the same object.
_handed_over = lru_cache(hand_over)
_grids = lru_cache(distortion_grids)


@lru_cache
def _lenses(results: Results, world: World, freed: Freed, terms: tuple[str, ...]) -> Lenses:
    return lenses_of(results, _handed_over(results, world, freed), terms)
