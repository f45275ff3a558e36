"""Simulated flights with rigs: a penta camera, and four converging heads on a platform (DMC)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust.arrays import Floats
from adjust.block import Block
from adjust.camera.interior import FrameCamera, nominal_mounting
from adjust.geometry import rotation
from adjust.options import AdjustmentOptions
from adjust.parameters import State
from adjust.quality.cofactor import cofactor
from adjust.rig import RELATIVE_ROTATION
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.flight_plan import LineGroup
from adjust.simulate.heads import HeadSpecification
from adjust.simulate.noise import NoiseSpecification
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout
from adjust.simulate.system import SystemSpecification
from adjust.simulate.terrain import TerrainShape
from adjust.simulate.trajectory import FlightVariation
from adjust.simulate.truth import BlockSpecification
from adjust.solve.factorization import ReducedCofactor
from adjust.solve.gauss_newton import iterate
from adjust.solve.system import Observations, System

MILLIDEGREE = np.deg2rad(1e-3)
ONE_THREAD = AdjustmentOptions(critical_value=None, threads=1)
# GNSS 5 cm, INS 0.003°, 0.003°, 0.008°, control 2 cm.
NOISE = NoiseSpecification(
    image=1.2e-6,
    control=(0.02, 0.02, 0.02),
    gnss=(0.05, 0.05, 0.05),
    ins=(3.0 * MILLIDEGREE, 3.0 * MILLIDEGREE, 8.0 * MILLIDEGREE),
)
CONTROL = (SurveyLayout("grid", columns=3, rows=3),)
_UCE = FrameCamera("nadir", 13077, 20019, 5.2e-6, 0.080, (0.0, 0.0), "corner", 0)
_PAN = FrameCamera("PAN", 7168, 4096, 12e-6, 0.120, (0.0, 0.0), "corner", 90)


def _lines(lines: int, exposures: int, height: float, base: float, spacing: float) -> tuple[LineGroup, ...]:
    return (LineGroup("L", "1", 0, 0.0, height, (exposures,) * lines, base, spacing),)


def _turned(generator: np.random.Generator) -> tuple[float, float, float]:
    """What a mounting is off what is stated of it: some hundredths of a degree."""
    roll, pitch, yaw = generator.normal(0.0, 20.0 * MILLIDEGREE, 3)
    return float(roll), float(pitch), float(yaw)


def penta(
    lines: int = 4,
    exposures: int = 10,
    points: int = 1500,
    aside_deg: float = 45.0,
    seed: int = 7,
    late: float = 0.0,
    **changes: object,
) -> BlockSpecification:
    """A nadir head and four that look forward, back, left and right; 1,000 m, overlaps 76 % and 50 %.

    The body turns by 1° per second; the heads to the left and ahead are exposed some seconds ``late``.
    """
    generator = np.random.default_rng(71)
    aside = float(np.deg2rad(aside_deg))
    views = {
        "left": ((aside, 0.0, 0.0), (0.0, -0.15, 0.05)),
        "right": ((-aside, 0.0, 0.0), (0.0, 0.15, 0.05)),
        "forward": ((0.0, aside, 0.0), (0.2, 0.0, 0.05)),
        "backward": ((0.0, -aside, 0.0), (-0.2, 0.0, 0.05)),
    }
    heads = tuple(
        HeadSpecification(
            number,
            0,
            angles,
            place,
            rotation_change=_turned(generator),
            synchronisation_change=late if name in ("left", "forward") else 0.0,
        )
        for number, (name, (angles, place)) in enumerate(views.items(), start=1)
    )
    cameras = (_UCE, *(replace(_UCE, name=name, focal_length=0.120) for name in views))
    specification = BlockSpecification(
        cameras,
        _lines(lines, exposures, 1000.0, 204.0, 650.0),
        PointSpecification(points),
        NOISE,
        CONTROL,
        terrain=TerrainShape(mean=0.0, relief=15.0),
        system=SystemSpecification(boresight=(4e-4, -3e-4, 5e-4)),
        variation=FlightVariation(rate=(np.deg2rad(1.0),) * 3),
        seed=seed,
        heads=heads,
    )
    return replace(specification, **changes)  # type: ignore[arg-type]


def dmc(points: int = 2000, seed: int = 8, **changes: object) -> BlockSpecification:
    """Four heads that look across a platform which takes no picture itself; 2,000 m, overlaps 60 %."""
    generator = np.random.default_rng(81)
    body = np.diag([1.0, -1.0, -1.0])
    heads = []
    for number, (side_x, side_y) in enumerate(((1, -1), (-1, -1), (-1, 1), (1, 1)), start=1):
        # Platform axes: x forward, y to the left, z up; the axis of a head meets the other side.
        angles = np.deg2rad([-18.0 * side_y, 10.1 * side_x, 90.0])
        turn = body @ rotation.from_omega_phi_kappa(angles) @ nominal_mounting(90).T
        yaw, pitch, roll = rotation.to_heading_pitch_roll(turn)
        place = (0.064 * side_x, -0.079 * side_y, 0.0)
        stated = (float(roll), float(pitch), float(yaw))
        heads.append(
            HeadSpecification(number, 0, stated, place, rotation_change=_turned(generator), of_platform=True)
        )
    platform = replace(_PAN, name="platform", mount_deg=0)
    specification = BlockSpecification(
        (platform, *(replace(_PAN, name=f"PAN{number}") for number in range(1, 5))),
        _lines(4, 10, 2000.0, 614.0, 1106.0),
        PointSpecification(points),
        replace(NOISE, image=2.4e-6),
        CONTROL,
        terrain=TerrainShape(mean=0.0, relief=15.0),
        seed=seed,
        heads=tuple(heads),
    )
    return replace(specification, **changes)  # type: ignore[arg-type]


def flown(specification: BlockSpecification) -> SimulatedBlock:
    """The flight, measured."""
    return simulate_block(specification)


def at_the_truth(
    simulated: SimulatedBlock, free: tuple[str, ...], observations: Observations | None = None
) -> tuple[System, State, ReducedCofactor]:
    """System, adjusted state and cofactors of an adjustment without rejection."""
    block = simulated.block(free)
    system = System.of(block, observations or simulated.observations(block))
    solution = iterate(system, block.approximate_state(), 20)
    return system, solution.state, cofactor(system, solution).without_joins(system.layout).reduced


def rotation_covariance(block: Block, state: State, corner: Floats) -> tuple[Floats, Floats]:
    """Which cameras (k,) are free heads, and the covariance (k, 3, k, 3) of their small rotations μ.

    M ← exp(μ) M, in body axes.
    """
    columns = block.layout.columns[RELATIVE_ROTATION]
    heads = np.flatnonzero((columns >= 0).all(axis=1))
    turned = rotation.roll_pitch_yaw_jacobian(state.system[RELATIVE_ROTATION][heads])
    own = corner[np.ix_(columns[heads].ravel(), columns[heads].ravel())]
    joint = np.einsum("aij,ajbk,blk->aibl", turned, own.reshape(len(heads), 3, len(heads), 3), turned)
    return heads, joint


def relative_sigma(joint: Floats, one: int, other: int) -> Floats:
    """Standard deviations (3,) of μ_other − μ_one."""
    difference = joint[other, :, other] + joint[one, :, one] - joint[one, :, other] - joint[other, :, one]
    return np.asarray(np.sqrt(np.diagonal(difference)))
