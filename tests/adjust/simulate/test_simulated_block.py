from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.camera.interior import FrameCamera
from adjust.camera.refraction import refraction_coefficient
from adjust.parameters import (
    BORESIGHT,
    FAMILIES,
    GNSS_DRIFT,
    GNSS_SHIFT,
    GNSS_STRIP_BIAS,
    INS_DRIFT,
    INS_STRIP_BIAS,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    TIME_OFFSET,
)
from adjust.simulate.block import simulate_block
from adjust.simulate.image_errors import ImageErrorSpecification
from adjust.simulate.system import SystemSpecification
from adjust.simulate.truth import BlockSpecification, block_truth
from tests.adjust.simulate.specifications import (
    CAMERA,
    errors_of,
    on_the_earth,
    small_specification,
    without_noise,
)

EVERYTHING = SystemSpecification(
    interior_change=(-8e-6, 4e-6, -6e-6),
    boresight=(5e-3, -3e-3, 8e-3),
    lever_arm=(0.4, -0.2, -1.1),
    gnss_shift=(-0.26, 0.12, 0.29),
    gnss_shift_of_flight={"2": (0.1, 0.2, 0.3)},
    strip_bias=(0.03, 0.03, 0.05),
    strip_drift=(1e-3, 1e-3, 2e-3),
    ins_strip_bias=(3e-4, 3e-4, 5e-4),
    ins_drift=(2e-6, 2e-6, 5e-6),
    time_offset=0.004,
)


def _calibration_flight(**changes: object) -> BlockSpecification:
    """Both pairs of lines again at twice the height and forward and reverse, as another flight."""
    low = small_specification().flight
    high = tuple(
        replace(
            group,
            name=f"H{group.name}",
            flight="2",
            height=2.0 * group.height,
            base=2.0 * group.base,
            spacing=2.0 * group.spacing,
            pattern="both",
            speed=60.0,
        )
        for group in low
    )
    return without_noise(small_specification(flight=(*low, *high), **changes))


@pytest.mark.parametrize("place", ["local", "earth"])
@pytest.mark.parametrize("mount_deg", [0, 90, 180, 270])
def test_observations_without_noise_contradict_the_truth_nowhere(place: str, mount_deg: int) -> None:
    """Every functional model of the adjustment is zero at the truth, all effects together."""
    cameras = (replace(CAMERA, mount_deg=mount_deg),)
    specification = _calibration_flight(system=EVERYTHING, cameras=cameras)
    simulated = simulate_block(on_the_earth(specification) if place == "earth" else specification)
    observations = simulated.observations(simulated.block(tuple(FAMILIES)))
    for group in observations.groups:
        if not group.name.startswith("prior"):
            misclosure = group.linearize(simulated.true_state()).misclosure
            present = group.stochastic.present
            limit = {"m": 1e-8, "rad": 1e-12}[group.unit]
            limit = 1e-14 if group.name == "image_points" else limit
            assert np.abs(misclosure[present]).max() < limit, group.name


def test_an_adjustment_without_noise_gives_the_truth_back() -> None:
    free = (BORESIGHT, GNSS_SHIFT, INTERIOR_ORIENTATION, TIME_OFFSET, LEVER_ARM)
    system = replace(
        EVERYTHING,
        strip_bias=(0.0,) * 3,
        strip_drift=(0.0,) * 3,
        ins_strip_bias=(0.0,) * 3,
        ins_drift=(0.0,) * 3,
    )
    # s_z and l_z differ only by tilts, which are made large here.
    specification = _calibration_flight(system=system)
    variation = replace(specification.variation, attitude=(0.15, 0.15, 0.15))
    simulated = simulate_block(on_the_earth(replace(specification, variation=variation)))
    block = simulated.block(free)
    result = adjust_block(block, simulated.observations(block))
    errors = errors_of(result, simulated.true_state())
    assert np.abs(errors.positions).max() < 1e-7
    assert np.abs(errors.attitudes).max() < 1e-10
    assert np.abs(errors.points).max() < 1e-7
    for family in free:
        true = simulated.true_state().system[family]
        np.testing.assert_allclose(result.state.system[family], true, atol=1e-7)
    assert result.test.sigma0 < 1e-5


def test_strip_biases_and_drifts_come_with_the_priors_they_were_drawn_from() -> None:
    simulated = simulate_block(small_specification(system=EVERYTHING, flight=_calibration_flight().flight))
    block = simulated.block((GNSS_SHIFT, GNSS_STRIP_BIAS, GNSS_DRIFT))
    priors = {group.name: group for group in simulated.observations(block).others}
    sigma = priors["prior:gnss_strip_bias"].stochastic.sigma
    assert sigma.shape == (len(simulated.truth.plan.strips), 3)
    np.testing.assert_allclose(sigma[0], EVERYTHING.strip_bias)
    assert "prior:gnss_drift" in priors
    assert "prior:gnss_shift" not in priors


def test_ins_biases_and_drifts_of_strips_are_found_within_their_standard_deviations() -> None:
    system = SystemSpecification(ins_strip_bias=(3e-4, 3e-4, 6e-4), ins_drift=(3e-5, 3e-5, 6e-5))
    simulated = simulate_block(small_specification(system=system))
    block = simulated.block((INS_STRIP_BIAS, INS_DRIFT))
    result = adjust_block(block, simulated.observations(block))
    table = result.to_dataframe("parameters")
    for family in (INS_STRIP_BIAS, INS_DRIFT):
        own = table[table["parameter"].str.startswith(family)]
        true = simulated.true_state().system[family].ravel()
        assert np.abs((own["value"] - true) / own["sigma"]).max() < 4.0
        assert np.abs(true / own["sigma"]).max() > 10.0
    held = simulated.block()
    assert adjust_block(held, simulated.observations(held)).test.sigma0 > 1.2 * result.test.sigma0


def test_groups_can_be_left_out() -> None:
    simulated = simulate_block(small_specification())
    block = simulated.block()
    names = [group.name for group in simulated.observations(block, without=("ins_attitudes",)).groups]
    assert names == ["image_points", "control_points", "gnss_positions"]


def test_every_flight_has_its_shift() -> None:
    truth = block_truth(_calibration_flight(system=EVERYTHING))
    np.testing.assert_allclose(truth.state.system[GNSS_SHIFT], [[-0.26, 0.12, 0.29], [0.1, 0.2, 0.3]])


def test_refraction_displaces_rays_outward_by_k_tan() -> None:
    system = SystemSpecification(refraction=True)
    straight = block_truth(small_specification(system=SystemSpecification()))
    bent = block_truth(small_specification(system=system))
    np.testing.assert_array_equal(bent.point, straight.point)
    # Nadir images: radial, dr = K r (1 + r²/c²); the tilts of 1° turn a little of it about.
    radius = np.hypot(*straight.xy.T)
    displacement = bent.xy - straight.xy
    outward = np.sum(displacement * straight.xy, axis=1) / radius
    camera, ground = np.array([1200.0]), np.array([200.0])
    coefficient = refraction_coefficient(camera, ground)[0]
    expected = coefficient * radius * (1.0 + (radius / CAMERA.focal_length) ** 2)
    far = radius > 0.02
    np.testing.assert_allclose(outward[far], expected[far], rtol=0.25)
    assert np.median(outward[far] / expected[far]) == pytest.approx(1.0, abs=0.02)


def test_systematic_image_errors_stand_in_the_measured_coordinates() -> None:
    errors = ImageErrorSpecification(radial=3e-6, corner=2e-6)
    plain = block_truth(small_specification())
    wrong = block_truth(small_specification(image_errors=errors))
    error = wrong.image_errors[0].error(wrong.xy)
    np.testing.assert_allclose(wrong.xy - plain.xy, error, atol=1e-15)
    assert np.abs(error).max() > 2e-6


def test_two_cameras_keep_their_own_interior_orientation() -> None:
    other = FrameCamera("D", 8000, 8000, 7e-6, 0.1, (1e-4, -2e-4), "corner", 90)
    one, two = small_specification().flight
    specification = without_noise(
        small_specification(cameras=(CAMERA, other), flight=(one, replace(two, camera=1)))
    )
    simulated = simulate_block(specification)
    block = simulated.block((BORESIGHT, GNSS_SHIFT))
    result = adjust_block(block, simulated.observations(block))
    assert np.abs(errors_of(result, simulated.true_state()).points).max() < 1e-6
    assert result.state.system[INTERIOR_ORIENTATION].shape == (2, 3)


def test_two_cameras_have_different_image_errors() -> None:
    other = replace(CAMERA, name="D")
    errors = ImageErrorSpecification(tile_shift=1e-6, corner=1e-6)
    truth = block_truth(small_specification(cameras=(CAMERA, other), image_errors=errors))
    one, two = truth.image_errors
    assert not np.allclose(one.tile_shift, two.tile_shift, atol=1e-8)
