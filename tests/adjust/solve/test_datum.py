"""What fixes a block in space, and what is said when something does not."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.errors import DatumDefectError
from adjust.parameters import BORESIGHT, GNSS_SHIFT, GNSS_STRIP_BIAS, INTERIOR_ORIENTATION, LEVER_ARM
from adjust.result import AdjustmentResult
from adjust.solve.datum import DATUM_DIRECTIONS, datum_basis, datum_shares, movements_of_points
from adjust.solve.design_matrix import design_matrix
from adjust.solve.system import System
from tests.adjust.scenes import two_strips

FOCAL_LENGTH = {INTERIOR_ORIENTATION: [True, False, False]}
SHIFT_AND_ARM = {GNSS_SHIFT: True, LEVER_ARM: True}


def adjusted(**switches: object) -> AdjustmentResult:
    scene = two_strips(**switches)
    return adjust_block(scene.block, scene.observations)


def defect(**switches: object) -> DatumDefectError:
    with pytest.raises(DatumDefectError) as caught:
        adjusted(**switches)
    return caught.value


def sigma(result: AdjustmentResult) -> dict[str, float]:
    """Standard deviation of every free system parameter."""
    names = [name for name, _, _ in result.layout.border_names()]
    return dict(zip(names, np.sqrt(np.diagonal(result.cofactor.reduced.corner)), strict=True))


def test_image_points_do_not_notice_a_similarity_movement() -> None:
    scene = two_strips(control=(), gnss=False, ins=False, start_seed=3)
    system = System.of(scene.block, scene.observations)
    state = scene.block.approximate_state()
    design = design_matrix(system, state)
    of_exposures = datum_basis(state)
    of_points = movements_of_points(state, np.arange(len(state.object_point)))
    movement = np.concatenate([of_exposures.reshape(-1, 7), of_points.reshape(-1, 7)])
    noticed = np.linalg.norm(design.matrix @ movement, axis=0)
    entries = np.linalg.norm(abs(design.matrix) @ np.abs(movement), axis=0)
    assert np.all(noticed < 1e-11 * entries)


def test_a_block_without_anything_outside_misses_all_seven_directions() -> None:
    error = defect(control=(), gnss=False, ins=False)
    assert error.defect == 7
    assert error.parameters == DATUM_DIRECTIONS
    assert "Nothing fixes the rotation about z of the block." in error.explanation
    assert "Add observations that determine them, or hold the named parameters fixed." in str(error)


def test_attitudes_alone_leave_position_and_scale() -> None:
    error = defect(control=(), gnss=False)
    assert error.parameters == ("shift in x", "shift in y", "shift in z", "scale")


def test_parameters_with_a_prior_are_not_blamed_for_a_missing_datum() -> None:
    error = defect(control=(), gnss=False, free={BORESIGHT: True}, priors={BORESIGHT: 0.01})
    assert error.parameters == ("shift in x", "shift in y", "shift in z", "scale")


def test_control_in_plan_leaves_the_height() -> None:
    error = defect(control=("plan",) * 5, gnss=False, ins=False)
    assert (error.defect, error.parameters) == (1, ("shift in z",))


def test_control_in_height_leaves_plan_position_and_azimuth() -> None:
    error = defect(control=("height",) * 5, gnss=False, ins=False)
    assert error.defect == 3
    assert set(error.parameters) == {"shift in x", "shift in y", "rotation about z"}


def test_two_control_points_leave_the_rotation_about_their_line() -> None:
    error = defect(control=("full", "full"), gnss=False, ins=False)
    assert error.defect == 1
    assert "combines" in error.explanation[0]
    assert "rotation about x" in error.parameters


@pytest.mark.parametrize(
    "switches",
    [
        {"control": ("full",) * 3, "gnss": False, "ins": False},
        {"control": (), "ins": False},
        {"control": (), "ins": True},
    ],
    ids=["three control points", "GNSS alone", "GNSS and INS"],
)
def test_each_of_these_alone_fixes_the_block(switches: dict[str, object]) -> None:
    result = adjusted(start_seed=1, **switches)
    assert result.test.redundancy > 0


def test_a_free_shift_without_control_goes_with_the_block() -> None:
    error = defect(control=(), free={GNSS_SHIFT: True})
    assert error.defect == 3
    assert (
        "Nothing fixes the shift in x of the block together with gnss_shift_x of flight_0."
        in error.explanation
    )


def test_a_boresight_without_attitudes_is_named() -> None:
    error = defect(control=("full",) * 4, gnss=False, ins=False, free={BORESIGHT: True})
    assert error.parameters == tuple(
        f"{name} of forward" for name in ("boresight_roll", "boresight_pitch", "boresight_yaw")
    )
    assert error.explanation[0] == "No observation depends on boresight_roll of forward."


def test_a_lever_arm_without_positions_is_named() -> None:
    error = defect(gnss=False, free={LEVER_ARM: True})
    assert error.defect == 3
    assert all(name.startswith("lever_arm") for name in error.parameters)


def test_lever_arm_and_shift_cannot_be_told_apart_on_one_level_heading() -> None:
    # Without tilts, jitter of the heading or curvature the two are the same thing.
    error = defect(frame="cartesian", headings_deg=(90.0,), tilt_deg=0.0, free=SHIFT_AND_ARM)
    assert error.defect == 3
    assert "lever_arm_x of forward and gnss_shift_x of flight_0 cannot be separated." in error.explanation


def test_opposite_headings_separate_the_horizontal_lever_arm_from_the_shift() -> None:
    one = sigma(adjusted(headings_deg=(90.0,), free=SHIFT_AND_ARM))
    opposite = sigma(adjusted(headings_deg=(90.0, 270.0), free=SHIFT_AND_ARM))
    for name in ("lever_arm_x", "lever_arm_y", "gnss_shift_x", "gnss_shift_y"):
        assert one[name] > 20.0 * opposite[name]
    # Up stays up on any heading: the vertical arm is still one with the shift.
    assert opposite["lever_arm_z"] > 0.5 * one["lever_arm_z"]


def test_strip_biases_without_prior_are_one_with_the_shift() -> None:
    error = defect(free={GNSS_STRIP_BIAS: True, GNSS_SHIFT: True})
    assert error.defect == 3
    assert {"gnss_shift_x of flight_0", "gnss_strip_bias_x of strip_0"} <= set(error.parameters)


def test_focal_length_needs_a_second_height_or_positions() -> None:
    control_only = sigma(adjusted(gnss=False, ins=False, free=FOCAL_LENGTH))["focal_length"]
    with_positions = sigma(adjusted(free=FOCAL_LENGTH))["focal_length"]
    free_shift = sigma(adjusted(free={**FOCAL_LENGTH, GNSS_SHIFT: True}))["focal_length"]
    assert control_only > 20.0 * with_positions
    assert free_shift > 5.0 * with_positions
    # Terrain of ± 60 m under 1000 m hardly separates it from the flying height: more than 50 µm.
    assert control_only > 50e-6


def test_shares_say_which_group_holds_which_direction() -> None:
    result = adjusted(control=("height",) * 3, ins=False)
    shares = {share.direction: share for share in result.datum}
    assert list(shares) == list(DATUM_DIRECTIONS)
    assert shares["shift in x"].shares == (("gnss_positions", pytest.approx(1.0)),)
    # n positions of 0.05 m: σ/√n.
    assert shares["shift in x"].sigma == pytest.approx(0.05 / np.sqrt(10), rel=1e-3)
    held_by = dict(shares["shift in z"].shares)
    information = {"control_points": 3 / 0.03**2, "gnss_positions": 10 / 0.10**2}
    total = sum(information.values())
    for name, part in information.items():
        assert held_by[name] == pytest.approx(part / total, rel=1e-3)


def test_a_direction_nothing_holds_has_an_infinite_sigma() -> None:
    scene = two_strips(control=(), gnss=False, ins=True)
    shares = datum_shares(System.of(scene.block, scene.observations), scene.block.approximate_state())
    by_name = {share.direction: share.sigma for share in shares}
    assert by_name["shift in x"] == by_name["scale"] == np.inf
    assert by_name["rotation about z"] == pytest.approx(0.005 * np.pi / 180 / np.sqrt(10), rel=1e-3)


@pytest.mark.parametrize("frame", ["cartesian", "topocentric"])
def test_distances_hold_the_scale_and_nothing_else(frame: str) -> None:
    """What a rotation does to both ends is equal but for rounding: it had a σ of 1e11."""
    scene = two_strips(control=(), gnss=False, ins=False, distances=5, frame=frame, start_seed=3)
    state = scene.block.approximate_state()
    shares = datum_shares(System.of(scene.block, scene.observations), state)
    (distances,) = scene.observations.others
    lengths = -distances.linearize(state).misclosure + distances.given[:, None]
    for share in shares:
        if share.direction == "scale":
            assert share.sigma == pytest.approx(0.01 / np.linalg.norm(lengths), rel=1e-9)
            assert share.shares == (("distances", 1.0),)
        else:
            assert (share.sigma, share.shares) == (np.inf, ())
