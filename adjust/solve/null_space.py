"""What singular normal equations leave undetermined: eigenvectors of zero, by inverse iteration.

The fronts that factorise a block also factorise its matrix with a small number ε added to the diagonal.
Solving with that stretches what is undetermined by 1/ε, and everything else by less: after some solutions of
a few random vectors nothing else is left of them (Golub and Van Loan 2013, section 8.2). That takes the time
of some adjustments; all eigenvalues of the matrix would take minutes from a thousand images on.
"""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.solve.helmert_blocking import HelmertFactor, factorize_blocks
from adjust.solve.normal_equations import ReducedNormals

# Vectors at first; as long as all of them are undetermined there are twice as many.
_VECTORS = 24
_ITERATIONS = 20
# Added to a unit diagonal, the smallest that makes the matrix positive definite in spite of its rounding.
_SHIFTS = (1e-10, 1e-8, 1e-6, 1e-4, 1e-2)


def null_space(
    normals: ReducedNormals, scale_exposure: Floats, scale_border: Floats, limit: float, threads: int
) -> Floats:
    """Orthonormal eigenvectors (6 n + g, d) of D S D whose eigenvalues are below a limit; one at least.

    Parameters
    ----------
    scale_exposure, scale_border : the diagonal matrix D, (n, 6) and (g,), which makes the diagonal 1; zero
        where nothing is left of it.
    """
    factor, shift = _shifted(normals, scale_exposure, scale_border, threads)
    unknowns, generator = scale_exposure.size + len(scale_border), np.random.default_rng(0)
    x = np.zeros((unknowns, 0))
    while True:
        more = min(max(x.shape[1], _VECTORS), unknowns - x.shape[1])
        x = np.concatenate([x, generator.standard_normal((unknowns, more))], axis=1)
        for _ in range(_ITERATIONS):
            x = np.linalg.qr(_solved(factor, x))[0]
        stretched, vectors = np.linalg.eigh(x.T @ _solved(factor, x))
        null: Floats = x @ vectors[:, 1.0 / stretched - shift < limit]
        if null.shape[1] == 0:
            return np.asarray(x @ vectors[:, -1:])
        if null.shape[1] < x.shape[1] or x.shape[1] == unknowns:
            return null


def _shifted(
    normals: ReducedNormals, scale_exposure: Floats, scale_border: Floats, threads: int
) -> tuple[HelmertFactor, float]:
    """The factors of D S D + ε I, and ε."""
    pattern = normals.pattern
    row, column = scale_exposure[pattern.row], scale_exposure[pattern.column]
    blocks = row[:, :, None] * normals.blocks * column[:, None, :]
    border = scale_exposure[:, :, None] * normals.border * scale_border
    corner = scale_border[:, None] * normals.corner * scale_border
    for shift in _SHIFTS:
        raised = blocks.copy()
        raised[pattern.diagonal] += shift * np.eye(6)
        factor = factorize_blocks(
            normals.blocking,
            raised,
            border,
            corner + shift * np.eye(len(corner)),
            np.ones_like(scale_exposure),
            np.ones_like(scale_border),
            threads,
        )
        if factor is not None:
            return factor, shift
    raise np.linalg.LinAlgError("the normal equations are not positive semidefinite")


def _solved(factor: HelmertFactor, x: Floats) -> Floats:
    """Solutions (6 n + g, k) for right-hand sides of the same shape."""
    n, g = factor.scale_exposure.shape[0], len(factor.scale_border)
    of_exposures, of_border = factor.solve(
        x[: 6 * n].reshape(n, 6, -1), np.ascontiguousarray(x[6 * n : 6 * n + g])
    )
    return np.concatenate([of_exposures.reshape(6 * n, -1), of_border])
