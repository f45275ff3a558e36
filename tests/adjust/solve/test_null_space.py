"""What singular normal equations leave undetermined is what all eigenvectors of the dense matrix say."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.solve.factorization import SingularNormalsError, factorize
from adjust.solve.normal_equations import ReducedNormals, reduced_normals
from adjust.solve.system import Observations, System
from tests.adjust.scenes import Scene, variants
from tests.adjust.solve.dense_normals import dense_matrix

VARIANTS = variants()
#: Eigenvalues of the matrix with a unit diagonal below it are zero.
LIMIT = 1e-9


def normals_of(scene: Scene, unseen: int) -> ReducedNormals:
    """From image points alone, of all images but the first ones."""
    rays = scene.observations.image_points
    left = Observations(rays.without(rays.event < unseen), ())
    system = System.of(scene.block, left)
    return reduced_normals(system, scene.block.approximate_state())


@pytest.mark.parametrize("unseen", [0, 3, 5])
@pytest.mark.parametrize("name", list(VARIANTS))
def test_undetermined_directions_are_those_of_the_dense_matrix(name: str, unseen: int) -> None:
    normals = normals_of(VARIANTS[name], unseen)
    with pytest.raises(SingularNormalsError) as raised:
        factorize(normals)
    scale = raised.value.scale
    found = raised.value.null_space / scale[:, None]
    values, vectors = np.linalg.eigh(dense_matrix(normals) * np.outer(scale, scale))
    expected = vectors[:, values < LIMIT]
    assert found.shape == expected.shape
    np.testing.assert_allclose(found.T @ found, np.eye(found.shape[1]), atol=1e-9)
    # Of the same space: nothing of the one is left without the other.
    np.testing.assert_allclose(expected @ (expected.T @ found), found, atol=1e-6)
