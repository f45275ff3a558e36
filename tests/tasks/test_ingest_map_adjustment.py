"""Orientations that another program adjusted in the map: the true ones are found again."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from adjust.geometry.rotation import from_omega_phi_kappa
from adjust.handover.refit import Freed
from tasks.deliveries.exposures import exposure_columns
from tasks.errors import InputError
from tasks.handover.delivery import Angles, Delivery
from tasks.handover.formats.register import REGISTER
from tasks.handover.receiver import hand_over
from tasks.settings.base import PathContext
from tasks.settings.inputs import ExposuresInput
from tests.tasks.handover.flown_block import GROUND, UTM, Flight, flown

MERIDIAN, EDGE = 9.0, 12.0
CASES = [
    (world, Flight(above, longitude_deg=longitude))
    for world, above, longitude in product(
        ("map-cartesian", "map-cartesian-curved"), (1000.0, 2000.0, 4000.0), (MERIDIAN, EDGE)
    )
]


def source(folder: Path, **changes: object) -> ExposuresInput:
    declared = {
        "file": "patb.ori",
        "format": "patb",
        "crs": "EPSG:25832",
        "heights": "ellipsoidal",
        "position": "projection_centre",
        "angles": {"order": "omega-phi-kappa", "unit": "deg", "reference": "grid"},
        "camera": "UC A",
        **changes,
    }
    return ExposuresInput.model_validate(declared, context=PathContext(folder))


def as_the_program_has_them(folder: Path, case: Flight, world: str, relief: float = 0.0):
    """The block, with a file of what a program of this kind would have found for it."""
    results, _ = flown(case)
    if relief:
        ground = results.ground[:, 1:2] + relief * case.above * np.array([-1.0, 0.0, 1.0])
        results = replace(results, ground=ground)
    handed = hand_over(results, world, Freed())
    (folder / "patb.ori").write_text(REGISTER["patb"].write(Delivery(results, handed, Angles()))["patb.ori"])
    return results, handed


def imported(folder: Path, results, **changes: object):
    frames = {one.frame.name: one.frame for one in results.cameras}
    columns, _, notes, _ = exposure_columns([source(folder, **changes)], tuple(frames), UTM, frames)
    position = np.column_stack([columns[f"{axis}_m"] for axis in "xyz"])
    angles = np.column_stack([columns[f"{name}_deg"] for name in ("omega", "phi", "kappa")])
    return position, from_omega_phi_kappa(np.radians(angles)), notes.problems


@pytest.mark.parametrize(("world", "case"), CASES, ids=str)
def test_the_true_orientations_are_found(tmp_path: Path, world: str, case: Flight) -> None:
    results, handed = as_the_program_has_them(tmp_path, case, world)
    true = results.images.map_pose
    position, turn, problems = imported(tmp_path, results, adjusted_in={"world": world, "ground_m": GROUND})
    before = np.abs(handed.pose.centre - true.centre).max()
    assert before > 0.15
    assert np.abs(position - true.centre).max() < 2e-4
    assert np.degrees(np.abs(turn - true.map_from_camera).max()) < 3e-7
    assert any("are converted to rigorous ones: heights change by" in problem for problem in problems)
    # As they stand they are off.
    there, _, _ = imported(tmp_path, results)
    np.testing.assert_allclose(there, handed.pose.centre, atol=1e-4)


@pytest.mark.parametrize(
    ("case", "relief", "wrong_m", "most_m"),
    [
        (Flight(1000.0, longitude_deg=EDGE), 0.1, 0.0, 0.02),
        (Flight(2000.0, longitude_deg=EDGE), 0.1, 50.0, 0.1),
        (Flight(1000.0, 45.0, longitude_deg=MERIDIAN), 0.02, 20.0, 0.05),
    ],
    ids=["relief", "relief and ground off by 50 m", "oblique, ground off by 20 m"],
)
def test_ground_that_is_not_quite_the_declared_one_changes_little(
    tmp_path: Path, case: Flight, relief: float, wrong_m: float, most_m: float
) -> None:
    world = "map-cartesian"
    results, handed = as_the_program_has_them(tmp_path, case, world, relief)
    true = results.images.map_pose.centre
    declared = {"world": world, "ground_m": GROUND + wrong_m}
    position, _, _ = imported(tmp_path, results, adjusted_in=declared)
    print(f"{np.abs(handed.pose.centre - true).max():.3f} → {np.abs(position - true).max():.4f} m")
    assert np.abs(position - true).max() < most_m


def test_other_angles_are_given_back_as_they_were_declared(tmp_path: Path) -> None:
    world = "map-cartesian"
    results, handed = as_the_program_has_them(tmp_path, Flight(), world)
    delivery = Delivery(results, handed, Angles("phi-omega-kappa", "gon"))
    (tmp_path / "itera.dat").write_text(REGISTER["bingo"].write(delivery)["itera.dat"])
    angles = {"order": "phi-omega-kappa", "unit": "gon", "reference": "grid"}
    declared = {"file": "itera.dat", "format": "bingo", "angles": angles}
    adjusted = {"world": world, "ground_m": GROUND}
    position, turn, _ = imported(tmp_path, results, **declared, adjusted_in=adjusted)
    true = results.images.map_pose
    np.testing.assert_allclose(position, true.centre, atol=3e-4)
    np.testing.assert_allclose(turn, true.map_from_camera, atol=1e-8)


IN_MAP = {"world": "map-cartesian", "ground_m": GROUND}


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"adjusted_in": {**IN_MAP, "ground_m": 3000.0}}, "below the ground"),
        ({"crs": "EPSG:4258", "adjusted_in": IN_MAP}, "not a map projection"),
        ({"adjusted_in": {**IN_MAP, "world": "map"}}, "map-cartesian"),
        ({"adjusted_in": {"world": "map-cartesian"}}, "ground_m"),
        ({"position": "antenna", "adjusted_in": IN_MAP}, "cannot have positions of an antenna"),
        (
            {
                "angles": {"order": "omega-phi-kappa", "unit": "deg", "reference": "true-north"},
                "adjusted_in": IN_MAP,
            },
            "about its grid",
        ),
    ],
    ids=["below the ground", "geographic", "another world", "no ground", "antenna", "true north"],
)
def test_what_cannot_be_is_refused(tmp_path: Path, changes: dict[str, object], what: str) -> None:
    results, _ = as_the_program_has_them(tmp_path, Flight(), "map-cartesian")
    with pytest.raises((InputError, ValidationError), match=what):
        imported(tmp_path, results, **changes)
