"""How mean residuals answer to corrections: by adjusting again, of two heads whose sets belong together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import linalg

from adjust.adjustment import adjust_block
from adjust.arrays import Floats
from adjust.options import AdjustmentOptions
from adjust.parameters import BORESIGHT, INTERIOR_ORIENTATION
from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.format_cells import FormatCells
from adjust.residual_grid.image_correction import CorrectionField
from adjust.residual_grid.image_sets import GridRule, ImageSets
from adjust.residual_grid.mean_response import MOST_TOGETHER, MeanResponse, SetMeans, together
from adjust.residual_grid.residual_grid import ResidualGrid
from adjust.rig import RELATIVE_ROTATION, SYNCHRONISATION_OFFSET
from adjust.selection.readjustment import Readjusted
from tests.adjust.scenes import two_strips

#: Of the field: far below the noise, far above what an iteration leaves.
_STEP = 2e-7


@dataclass(frozen=True, eq=False)
class TwoHeads:
    """The response of both sets of images of a rig, and the means with given corrections."""

    sets: ImageSets
    start: Readjusted
    response: MeanResponse

    @classmethod
    def of(cls, free: dict[str, object]) -> TwoHeads:
        scene = two_strips(noise_seed=5, heads=2, points_along=20, points_across=10, free=free)
        block = scene.block
        result = adjust_block(block, scene.observations)
        cells = tuple(FormatCells.of(camera.half_format, 3) for camera in block.cameras)
        sets = ImageSets.of(
            block, result, cells, block.camera_of_image, GridRule(), AdjustmentOptions(threads=1)
        )
        start, of_ray = Readjusted.of(result), block.camera_of_image[result.observations.image_points.image]
        own = [
            SetMeans(np.flatnonzero(of_ray == k), grid, np.isfinite(grid.mean).T)
            for k, grid in enumerate(grids(sets, start))
        ]
        return cls(sets, start, MeanResponse.of(result, own, controlled(result.groups[0]), "bilinear"))

    def means(self, values: Floats) -> Floats:
        """Mean residuals (c,) with corrections (c,)."""
        each = zip(self.response.sets, self.response.of_cells(values), strict=True)
        fields = tuple(CorrectionField(item.grid.cells, own) for item, own in each)
        now = self.sets.adjusted(fields, self.start.state)
        return self.response.of_known([grid.mean for grid in grids(self.sets, now)])

    def left(self, field: Floats) -> float:
        """Part of a field (c,) that corrections can contain."""
        return float(np.linalg.norm(self.response.contained @ field) / np.linalg.norm(field))

    def turned(self) -> Floats:
        """What a rotation of all images of the first head about its axis makes of its image coordinates."""
        first, second = (item.grid.cells.middles[:, ::-1] * [-1.0, 1.0] for item in self.response.sets)
        return self.response.of_known([first, 0.0 * second])


def grids(sets: ImageSets, now: Readjusted) -> list[ResidualGrid]:
    return [grid for grid in sets.means(now) if grid is not None]


@pytest.mark.parametrize("free", [{BORESIGHT: True}, {BORESIGHT: True, RELATIVE_ROTATION: True}])
def test_means_of_both_heads_answer_to_corrections_of_each(free: dict[str, object]) -> None:
    heads = TwoHeads.of(free)
    matrix, random = heads.response.matrix, np.random.default_rng(1)
    first, second = heads.response.parts
    for part, other in ((first, second), (second, first)):
        correction = np.zeros(len(matrix))
        correction[part] = random.normal(size=part.stop - part.start)
        change = heads.means(_STEP * correction) - heads.means(-_STEP * correction)
        expected = -2.0 * _STEP * matrix @ correction
        np.testing.assert_allclose(change, expected, atol=1e-3 * np.abs(expected).max())
        assert np.abs(expected[other]).max() > 0.02 * np.abs(expected[part]).max()


def test_only_what_is_free_is_imitated() -> None:
    # The other head shows how far the images of one are turned, unless rotations of heads are free.
    for free, is_contained in ((False, True), (True, False)):
        heads = TwoHeads.of({BORESIGHT: True, RELATIVE_ROTATION: free})
        left = heads.left(heads.turned())
        assert (left > 0.5) == is_contained
        assert left < 0.05 or is_contained
    # A held focal length is none of the corrections'.
    for free, is_contained in ((False, True), (True, False)):
        heads = TwoHeads.of({BORESIGHT: True, INTERIOR_ORIENTATION: free})
        field = heads.response.of_known([item.grid.cells.middles for item in heads.response.sets])
        left = heads.left(field)
        assert (left > 0.5) == is_contained


def test_what_the_means_show_is_never_imitated() -> None:
    # A head that is exposed later sees nearly what one that is turned sees, but for strips flown backwards.
    response = TwoHeads.of({BORESIGHT: True, RELATIVE_ROTATION: True, SYNCHRONISATION_OFFSET: True}).response
    fields = linalg.orth(np.eye(len(response.noise)) - response.contained)
    shown = response.matrix @ fields
    assert fields.shape[1] == 6
    assert np.linalg.svd(shown, compute_uv=False).max() < 0.1


def test_sets_are_together_as_far_as_matrices_allow() -> None:
    assert together([]) == []
    assert together([1300]) == [[0]]
    assert together([0, 100, 200, 0, 300]) == [[1, 2, 4]]
    assert together([MOST_TOGETHER - 1, 1, 1, MOST_TOGETHER]) == [[0, 1], [2], [3]]
