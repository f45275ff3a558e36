"""Every format with orientations, written and read again: the program sees the ground that we see.

5 × 5 pixels at three heights, 1, 2 and 4 km above ground, on the central meridian and at the edge of the zone, vertical and 45° oblique.
What a program of the kind ``map-cartesian`` cannot do was stated, and from a pixel it is refused.
"""  # noqa: E501

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from adjust.geometry.rotation import from_omega_phi_kappa, from_phi_omega_kappa
from adjust.handover.cartesian_map import EARTH_RADIUS_M, CartesianMap, Pose, on_ground
from tasks.formats.register import read_exposures
from tasks.handover.block_points import no_points
from tasks.handover.delivery import Delivery
from tasks.handover.formats.register import REGISTER
from tasks.handover.receiver import REFUSED_PX, hand_over
from tests.tasks.handover.flown_block import Flight, flown
from tests.tasks.handover.test_read_back import READ, SYSTEMS

MERIDIAN, EDGE = 9.0, 12.0
FEW = [
    Flight(1000.0, 0.0, refracted=True, longitude_deg=EDGE), Flight(2000.0, 0.0, longitude_deg=MERIDIAN),
    Flight(1000.0, 45.0, longitude_deg=MERIDIAN),
]  # fmt: skip
ALL = [
    Flight(above, tilt, refracted=refracted, longitude_deg=longitude)
    for above, tilt, longitude, refracted in product(
        (1000.0, 2000.0, 4000.0), (0.0, 45.0), (MERIDIAN, EDGE), (False, True)
    )
]
KINDS = [(name, world) for name in READ for world in REGISTER[name].worlds]


@pytest.mark.parametrize(("name", "world"), KINDS)
def test_the_program_sees_the_same_ground(name, world, tmp_path):
    for case in FEW:
        check(name, world, case, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("case", ALL, ids=str)
@pytest.mark.parametrize(("name", "world"), KINDS)
def test_the_program_sees_the_same_ground_everywhere(name, world, case, tmp_path):
    check(name, world, case, tmp_path)


def check(name, world, case, folder):
    results, _ = flown(case)
    form, images = REGISTER[name], results.images
    handed = hand_over(results, world, form.freed)
    if handed.misfit_px.max() >= REFUSED_PX:
        # Nothing is written: obliques on a map, or orientations without their camera from 2 km at the edge.
        assert world.startswith("map-cartesian")
        assert case.tilt_deg > 0.0 or case.above >= 2000.0
        return
    for file, text in form.write(Delivery(results, handed, points=no_points())).items():
        (folder / file).write_text(text, encoding="utf-8", newline="")
    pose = read_pose(name, folder, handed.pose)
    ideal = np.tile(images.grid_of_image_points(5), (1, 3, 1))
    height = np.repeat(results.ground, 25, axis=1)
    pixel_m = case.above / np.cos(np.radians(case.tilt_deg)) * images.pixel_size / images.focal_length
    if world in ("local", "map"):
        # The ground through the file less the ground through our own orientation.
        moved = seen_ground(pose, case) - seen_ground(handed.pose, case)
        assert np.abs(moved).max() < 1e-3
        return
    ground = images.ground(ideal, height)
    model = CartesianMap(EARTH_RADIUS_M if world.endswith("curved") else None)
    away = np.linalg.norm((on_ground(model, pose, ideal, height) - ground)[..., :2], axis=-1).max(axis=1)
    oblique = 1.0 / np.cos(np.radians(case.tilt_deg + 25.0)) ** 2
    assert (away < oblique * (1.2 * handed.misfit_px * pixel_m[images.camera] + 1e-3)).all()
    assert away.max() < oblique * pixel_m.max()


def seen_ground(pose, case):
    """Where rays of 45° and the vertical one end at the flying height below, straight in the world."""
    rays = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 1.0, -1.0]]) * case.above * np.sqrt(2.0)
    return pose.centre[:, None] + np.einsum("nij,kj->nki", pose.map_from_camera, rays)


def read_pose(name, folder, handed):
    file, reader, layout = READ[name]
    system = SYSTEMS.get(name)
    order = "omega-phi-kappa" if system is None else system.order
    records = read_exposures(reader, folder / file, order, layout)
    if system is None:
        turn = from_omega_phi_kappa(np.radians(records.angles))
    else:
        turn = from_phi_omega_kappa(records.angles * np.pi / 200.0)
    return Pose(records.position, turn, handed.focal_length, handed.radial)
