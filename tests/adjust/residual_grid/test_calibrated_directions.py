"""What σ of a calibration mean after corrections by mean residuals: directions have them, single values not.

Shifts of the CCD images are partly a principal point and a tilt. Corrections, interior orientation and
boresight share them as it happens, so that only all of them together are right.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.geometry import rotation
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, GNSS_SHIFT, INTERIOR_ORIENTATION
from adjust.residual_grid.format_cells import FormatCells, Seams
from adjust.residual_grid.image_correction import corrected
from adjust.residual_grid.iteration import iterate_grid
from adjust.result import AdjustmentResult
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.image_errors import ImageErrorSpecification
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout
from adjust.simulate.system import SystemSpecification
from tests.adjust.simulate.specifications import CAMERA, HEIGHT, small_specification
from tests.adjust.simulate.test_calibration_covariances import _lines

SEEDS = 20
HALF = np.array(CAMERA.half_format)
SEAMS = Seams(*((-half / 3.0, half / 3.0) for half in CAMERA.half_format))
CELLS = FormatCells.of(CAMERA.half_format, 9, SEAMS)
ONE_THREAD = AdjustmentOptions(threads=1)


ERRORS = {
    "shifts of the CCD images": ImageErrorSpecification(tile_shift=1.5e-6),
    "radial": ImageErrorSpecification(radial=4e-6),
}
#: The values of which the page names the errors: pitch, c, vertical shift.
NAMED = ((BORESIGHT, 1), (INTERIOR_ORIENTATION, 0), (GNSS_SHIFT, 2))


def flight(errors: ImageErrorSpecification, seed: int) -> SimulatedBlock:
    """44 images at two heights, noise of image points 1.5 µm."""
    return simulate_block(
        small_specification(
            flight=(
                _lines("E", 0.5 * np.pi, HEIGHT, (4, 4), 75.0),
                _lines("N", 0.0, HEIGHT, (4, 4), 75.0),
                _lines("HE", 0.5 * np.pi, 2.0 * HEIGHT, (3,), 75.0),
                _lines("HN", 0.0, 2.0 * HEIGHT, (3,), 75.0),
            ),
            points=PointSpecification(count=600, rays=3, detection=0.6),
            survey=(SurveyLayout("grid", columns=4, rows=4),),
            system=SystemSpecification(boresight=(5e-3, -4e-3, 8e-3), gnss_shift=(-0.5, 0.3, 0.6)),
            image_errors=errors,
            seed=seed,
        )
    )


def of_directions(simulated: SimulatedBlock, result: AdjustmentResult, correction: Floats) -> Floats:
    """Error over σ of where an errorless measurement at the middle of each cell points to in the body."""
    true, estimated = simulated.truth.state.system, result.state.system
    families = (INTERIOR_ORIENTATION, BORESIGHT)
    given, found = (np.concatenate([values[name][0] for name in families]) for values in (true, estimated))
    ideal = simulated.truth.image_errors[0].ideal_from_measured(CELLS.middles)

    def pointing(parameters: Floats, xy: Floats) -> Floats:
        """Along x and y of the true camera, as tangents."""
        ray = np.column_stack([xy - parameters[1:3], np.full(len(xy), -parameters[0])])
        turned = rotation.from_roll_pitch_yaw(np.array([given[3:], parameters[3:]])) @ CAMERA.body_from_camera
        seen = ray @ turned[1].T @ turned[0]
        return np.asarray(seen[:, :2] / seen[:, 2:])

    measured = CELLS.middles + given[1:3]
    error = pointing(found, measured + correction) - pointing(given, ideal + given[1:3])
    steps = 1e-6 * np.eye(6)
    jacobian = np.stack(
        [(pointing(found + h, measured) - pointing(found - h, measured)) / 2e-6 for h in steps], axis=-1
    )
    columns = np.concatenate([result.layout.columns[name][0] for name in families])
    covariance = result.test.sigma0**2 * result.cofactor.reduced.corner[np.ix_(columns, columns)]
    return np.asarray(error / np.sqrt(np.einsum("nik,kl,nil->ni", jacobian, covariance, jacobian)))


def of_values(simulated: SimulatedBlock, result: AdjustmentResult) -> list[float]:
    """Error over σ of the values that are named."""
    cofactor, found = np.diagonal(result.cofactor.reduced.corner), []
    for name, k in NAMED:
        error = result.state.system[name][0, k] - simulated.truth.state.system[name][0, k]
        found.append(error / result.test.sigma0 / np.sqrt(cofactor[result.layout.columns[name][0, k]]))
    return found


def ratios(errors: ImageErrorSpecification) -> tuple[float, float, Floats]:
    """RMS of error over σ: of directions without and with corrections, and of the named values with them."""
    without, having, values = [], [], []
    for seed in range(7_000, 7_000 + SEEDS):
        simulated = flight(errors, seed)
        block = simulated.block((INTERIOR_ORIENTATION, BORESIGHT, GNSS_SHIFT))
        observations = simulated.observations(block)
        first = adjust_block(block, observations, ONE_THREAD)
        fields = iterate_grid(block, first, (CELLS,), block.camera_of_image, options=ONE_THREAD).fields
        assert fields[0] is not None
        rays = corrected(observations.image_points, fields, block.camera_of_image, "bilinear")
        last = adjust_block(block, replace(observations, image_points=rays), ONE_THREAD)
        assert last.test.sigma0 == pytest.approx(1.0, abs=0.08)
        without.append(of_directions(simulated, first, np.zeros((len(CELLS.middles), 2))))
        having.append(of_directions(simulated, last, fields[0].value))
        values.append(of_values(simulated, last))
    one, other = (float(np.sqrt(np.mean(np.square(found)))) for found in (without, having))
    named = np.sqrt(np.mean(np.square(values), axis=0))
    print("directions without, with corrections:", round(one, 2), round(other, 2), "values:", named.round(1))
    return one, other, named


@pytest.mark.slow
def test_shifts_of_the_ccd_images_leave_directions_their_sigma_but_not_single_values() -> None:
    without, having, (pitch, _, _) = ratios(ERRORS["shifts of the CCD images"])
    assert without > 1.25
    assert 0.85 < having < 1.15
    assert pitch > 4.0


@pytest.mark.slow
def test_smooth_errors_stay_in_the_focal_length() -> None:
    without, having, (_, focal_length, shift) = ratios(ERRORS["radial"])
    assert without > having > 1.1
    assert focal_length > 2.5
    assert shift > 1.5
