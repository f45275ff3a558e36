"""The library without files: simulate a small block, adjust it, compare with the truth.

Prints

    σ0 1.012, redundancy 1,202
    boresight error over its σ: roll -0.4, pitch -1.0, yaw +0.8
    positions: true RMS error 0.022 m, stated 0.028 m
"""

import numpy as np

from adjust import AdjustmentOptions, FrameCamera, adjust_block
from adjust.simulate import (
    BlockSpecification,
    LineGroup,
    NoiseSpecification,
    PointSpecification,
    SurveyLayout,
    SystemSpecification,
    base_of,
    simulate_block,
    spacing_of,
)

HEIGHT_M = 1000.0
CAMERA = FrameCamera(
    name="camera",
    columns=9000,
    rows=12000,
    pixel_size=6e-6,
    focal_length=0.08,
    principal_point=(0.0, 0.0),
    pixel_origin="corner",
    mount_deg=0,
)
BASE, SPACING = base_of(CAMERA, HEIGHT_M, 0.6), spacing_of(CAMERA, HEIGHT_M, 0.6)
ATTITUDE = tuple(np.deg2rad([0.003, 0.003, 0.008]))

specification = BlockSpecification(
    cameras=(CAMERA,),
    flight=(
        LineGroup("E", "1", 0, np.pi / 2, HEIGHT_M, (5, 5), BASE, SPACING),
        LineGroup("N", "1", 0, 0.0, HEIGHT_M, (5, 5), BASE, SPACING),
    ),
    points=PointSpecification(count=150),
    noise=NoiseSpecification(image=1.5e-6, control=(0.02,) * 3, gnss=(0.05,) * 3, ins=ATTITUDE),
    survey=(SurveyLayout("grid", columns=3, rows=3),),
    system=SystemSpecification(boresight=(2e-3, -1e-3, 4e-3)),
    seed=5,
)

simulated = simulate_block(specification)
block = simulated.block(free={"boresight"})
result = adjust_block(block, simulated.observations(block), AdjustmentOptions())

truth = simulated.true_state()
covariance = result.cofactor.reduced
error = (result.state.system["boresight"] - truth.system["boresight"])[0]
roll, pitch, yaw = error / np.sqrt(np.diagonal(covariance.corner))
positions = result.state.projection_centre - truth.projection_centre
stated = np.diagonal(covariance.of_exposures, axis1=1, axis2=2)[:, :3]

print(f"σ0 {result.test.sigma0:.3f}, redundancy {result.test.redundancy:,}")
print(f"boresight error over its σ: roll {roll:+.1f}, pitch {pitch:+.1f}, yaw {yaw:+.1f}")
found, expected = np.sqrt(np.mean(positions**2)), np.sqrt(np.mean(stated))
print(f"positions: true RMS error {found:.3f} m, stated {expected:.3f} m")
