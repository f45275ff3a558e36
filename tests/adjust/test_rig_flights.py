"""What flights with rigs determine: mountings, and what counting one reading of the INS n times does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.geometry import rotation
from adjust.observations.base import StochasticModel
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.ins_attitude import InsAttitudes
from adjust.parameters import BORESIGHT, LEVER_ARM
from adjust.rig import OF_HEADS, RELATIVE_POSITION, RELATIVE_ROTATION, SYNCHRONISATION_OFFSET
from adjust.simulate.block import SimulatedBlock
from adjust.simulate.truth import BlockSpecification
from adjust.solve.design_matrix import design_matrix, full_cofactor
from adjust.solve.system import Observations, System
from tests.adjust.rig_flights import (
    MILLIDEGREE,
    at_the_truth,
    dmc,
    flown,
    penta,
    relative_sigma,
    rotation_covariance,
)

PAIRS = [(one, other) for other in range(4) for one in range(other)]


def test_four_converging_heads_have_the_expected_mountings() -> None:
    """Forty exposures, known positions and interior orientation: σ_INS/√40 in common, relative far less."""
    simulated = flown(dmc(points=1700))
    system, state, cofactors = at_the_truth(simulated, (RELATIVE_ROTATION,))
    assert len(simulated.truth.image) / len(system.block.events) == pytest.approx(219.0, rel=0.02)
    _, joint = rotation_covariance(system.block, state, cofactors.corner)
    absolute = np.sqrt(np.einsum("aiai->ai", joint)) / MILLIDEGREE
    np.testing.assert_allclose(absolute.mean(axis=0), [0.50, 0.50, 1.28], rtol=0.05)
    relative = np.array([relative_sigma(joint, *pair) for pair in PAIRS]) / MILLIDEGREE
    # The expected values have two decimals.
    np.testing.assert_allclose(np.median(relative, axis=0), [0.07, 0.07, 0.20], rtol=0.1, atol=0.005)


def test_oblique_heads_have_the_absolute_mounting_of_the_inertial_unit_in_common() -> None:
    simulated = flown(penta())
    system, state, cofactors = at_the_truth(simulated, (BORESIGHT, RELATIVE_ROTATION))
    boresight = np.sqrt(np.diagonal(cofactors.corner))[system.layout.columns[BORESIGHT][0]] / MILLIDEGREE
    np.testing.assert_allclose(boresight, [0.48, 0.48, 1.28], rtol=0.05)
    _, joint = rotation_covariance(system.block, state, cofactors.corner)
    relative = np.array([relative_sigma(joint, *pair) for pair in PAIRS]) / MILLIDEGREE
    assert np.all(relative < 0.1)


def standing_alone(simulated: SimulatedBlock) -> tuple[Block, Observations]:
    """The naive treatment: every picture has six unknowns and readings of GNSS and INS of its own.

    Each head has a boresight (free) and a lever arm (known), as if no other head were there.
    """
    block = simulated.block((BORESIGHT,))
    given = simulated.observations(block)
    rig, state = block.rig, simulated.truth.state
    assert rig is not None
    body = rotation.from_roll_pitch_yaw(state.system[BORESIGHT][rig.reference])
    angles = rotation.to_heading_pitch_roll(
        body @ rotation.from_roll_pitch_yaw(state.system[RELATIVE_ROTATION])
    )[:, ::-1]
    arm = state.system[LEVER_ARM][rig.reference] - np.einsum(
        "nij,nj->ni", body, state.system[RELATIVE_POSITION]
    )
    own = {BORESIGHT: angles, LEVER_ARM: arm}
    taken = np.isin(np.arange(len(block.cameras)), rig.camera_of_image)
    system = tuple(
        replace(
            one,
            values=own.get(one.family.name, one.values),
            free=np.broadcast_to(taken[:, None] & (one.family.name == BORESIGHT), one.free.shape)
            if one.family.name in own
            else one.free,
        )
        for one in block.system
        if one.family.name not in OF_HEADS
    )
    alone = replace(
        block,
        rig=None,
        system=system,
        projection_centre=state.pictures.projection_centre,
        local_from_camera=state.pictures.local_from_camera,
        object_point=state.object_point,
    )
    rows, camera = rig.event_of_image, rig.camera_of_image
    images = np.arange(len(block.images))
    groups = []
    for group in given.others:
        if isinstance(group, GnssPositions):
            assert group.motion is not None
            group = replace(
                group,
                event=images,
                camera=camera,
                flight=group.flight[rows],
                observed=group.observed[rows],
                local_from_enu=group.local_from_enu[rows],
                body_from_camera=alone.body_from_camera,
                stochastic=_of(group.stochastic, rows),
                motion=group.motion.of(rows),
            )
        elif isinstance(group, InsAttitudes):
            group = replace(
                group,
                event=images,
                camera=camera,
                observed=group.observed[rows],
                body_from_camera=alone.body_from_camera,
                stochastic=_of(group.stochastic, rows),
                turning=None,
                motion=None if group.motion is None else group.motion.of(rows),
            )
        groups.append(group)
    return alone, Observations(replace(given.image_points, event_of_image=None), tuple(groups))


def _of(model: StochasticModel, rows: np.ndarray) -> StochasticModel:
    return StochasticModel.from_sigma(model.sigma[rows])


def true_and_stated(
    block: Block, observations: Observations, readings: Ints, of_points: bool
) -> tuple[Floats, Floats, Floats]:
    """True and stated variance (3,) of a mean, and the part of GNSS and INS in the stated one.

    Parameters
    ----------
    readings : (events,) which reading every position and attitude repeats.
    of_points : the mean of all object points, or that of all projection centres.
    """
    system = System.of(block, observations)
    design = design_matrix(system, block.approximate_state())
    cofactors = full_cofactor(design)
    columns = design.point_columns[system.active_point] if of_points else design.exposure_columns[:, :3]
    mean = np.zeros((design.unknowns, 3))
    mean[columns, np.arange(3)] = 1.0 / len(columns)
    gains = design.matrix @ (cofactors @ mean)
    true, repeated = np.zeros(3), np.zeros(3)
    for k, group in enumerate(system.observations.groups):
        own = gains[design.row_start[k] : design.row_start[k + 1]].reshape(-1, len(group.components), 3)
        if isinstance(group, GnssPositions | InsAttitudes):
            repeated += np.sum(own**2, axis=(0, 1))
            summed = np.zeros((readings.max() + 1, *own.shape[1:]))
            np.add.at(summed, readings[group.event], own)
            own = summed
        true += np.sum(own**2, axis=(0, 1))
    stated = np.einsum("ui,uv,vi->i", mean, cofactors, mean)
    return true, stated, repeated / stated


@pytest.mark.parametrize(
    ("specification", "heads"),
    [
        pytest.param(dmc(points=500, survey=()), 4, marks=pytest.mark.slow),
        (penta(points=350, survey=()), 5),
    ],
)
def test_heads_that_stand_alone_state_a_datum_that_is_too_good(
    specification: BlockSpecification, heads: int
) -> None:
    """One reading of GNSS and INS counts once for each of n heads: by up to √n, where it alone decides.

    Eighteen exposures without control.
    """
    lines = tuple(replace(group, exposures=(6, 6, 6)) for group in specification.flight)
    simulated = flown(replace(specification, flight=lines))
    rig = simulated.truth.state.rig
    assert rig is not None
    block, observations = standing_alone(simulated)
    true, stated, part = true_and_stated(block, observations, rig.event_of_image, of_points=True)
    ratio = np.sqrt(true / stated)
    assert np.all(ratio > 1.4)
    assert np.all(ratio < np.sqrt(1.0 + (heads - 1) * part))
    # All readings have the same share in the mean of the projection centres.
    true, stated, part = true_and_stated(block, observations, rig.event_of_image, of_points=False)
    np.testing.assert_allclose(np.sqrt(true / stated), np.sqrt(heads), rtol=1e-6)
    # The boresight of a platform that takes no pictures is a common rotation of its heads.
    takes_pictures = np.isin(rig.reference, rig.camera_of_image).all()
    free = (BORESIGHT, RELATIVE_ROTATION) if takes_pictures else (RELATIVE_ROTATION,)
    together = simulated.block(free)
    once = simulated.observations(together)
    true, stated, _ = true_and_stated(together, once, np.arange(len(rig.events)), of_points=True)
    np.testing.assert_allclose(true, stated, rtol=1e-6)


def errors_over_sigma(simulated: SimulatedBlock) -> Floats:
    """Errors of boresight, lever arm, relative rotations and synchronisation in units of their σ."""
    families = (BORESIGHT, LEVER_ARM, RELATIVE_ROTATION, SYNCHRONISATION_OFFSET)
    system, state, cofactors = at_the_truth(simulated, families)
    sigma = np.sqrt(np.diagonal(cofactors.corner))
    found = []
    for family in families:
        columns = system.layout.columns[family]
        error = state.system[family] - simulated.truth.state.system[family]
        found.append(error[columns >= 0] / sigma[columns[columns >= 0]])
    return np.concatenate(found)


def penta_flight(late: float) -> SimulatedBlock:
    """Sixty exposures in four lines, of two heads some seconds late."""
    return flown(penta(lines=4, exposures=15, points=1200, late=late))


@pytest.mark.parametrize("late", [0.0, 2e-3])
def test_a_penta_camera_is_calibrated_within_its_standard_deviations(late: float) -> None:
    assert np.all(np.abs(errors_over_sigma(penta_flight(late))) < 2.5)


@pytest.mark.slow
@pytest.mark.parametrize("late", [0.0, 2e-3])
def test_errors_of_the_mounting_are_as_large_as_their_standard_deviations_say(late: float) -> None:
    """A hundred flights, 22 parameters each."""
    simulated = penta_flight(late)
    ratios = np.array([errors_over_sigma(simulated.measured_again(seed)) for seed in range(100)])
    assert ratios.shape == (100, 22)
    assert 0.95 < np.sqrt(np.mean(ratios**2)) < 1.05


def test_an_offset_that_is_not_known_spoils_the_mounting_and_shows() -> None:
    """Two heads 2 ms late, taken for synchronised: relative pitch takes what it can of 15 cm."""
    simulated = penta_flight(2e-3)
    system, state, cofactors = at_the_truth(simulated, (BORESIGHT, RELATIVE_ROTATION))
    columns = system.layout.columns[RELATIVE_ROTATION]
    error = (state.system[RELATIVE_ROTATION] - simulated.truth.state.system[RELATIVE_ROTATION])[1:]
    sigma = np.sqrt(np.diagonal(cofactors.corner))[columns[1:]]
    left, right, forward, backward = np.abs(error / sigma).max(axis=1)
    assert min(left, forward) > 20.0
    assert max(left, forward) > 3.0 * max(right, backward)
