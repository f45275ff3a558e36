"""Exterior orientations that follow from GNSS and INS alone, and what their errors come from.

Position and attitude of an exposure are six observation equations (``gnss_position``, ``ins_attitude``) for
its six elements, so with given system parameters p they have one solution without residuals,

    R_c = R_INS exp(−ω Δt) R_B(b) T,    X0 = A − R_INS exp(−ω Δt) l − s − β − d (t − t_k) − v Δt,

and the same equations, linearised and solved for the elements, say what the errors of the observations and of
the parameters make of them:

    dEO = A_EO⁻¹ (dl − A_p dp).

Noise that is correlated over time comes from independent draws. Standardized errors e of a first-order
Gauss–Markov process (``gauss_markov``) along a strip are

    e_i = Σ_j≤i exp(−(t_i − t_j)/τ) √(1 − φ_j²) w_j

with independent w of unit variance and the correlation φ_j of exposure j with the one before it, 0 for the
first of a strip: every draw lives on in all later exposures of its strip. Images of several heads that share
a reading share its draws.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse

from adjust.arrays import Floats, Ints
from adjust.errors import InconsistentBlockError
from adjust.geometry import rotation
from adjust.observations.base import Linearization, StochasticModel, Term
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.ins_attitude import InsAttitudes
from adjust.parameters import BORESIGHT, EXTERIOR_ORIENTATION, State


@dataclass(frozen=True, eq=False)
class DirectOrientations:
    """Orientations of n images from GNSS, INS and the system parameters; errors to first order.

    An orientation has six elements: the projection centre along local axes (metres) and a small rotation in
    the camera frame (radians), R ← R · exp(δ).

    Attributes
    ----------
    state : the orientations and the system parameters they were computed with; without object points.
    of_observations : (n, 6, 6) derivatives of the elements by the image's own position (three components in
        the axes it is weighted in) and attitude (small rotations in body axes).
    of_noise : (n, 6, 6) the same by errors of unit variance: times its transpose it is the covariance that
        the a-priori standard deviations of GNSS and INS give the elements of an image.
    over_time : (6 n, 6 n) the errors of unit variance from independent ones; None where they are independent.
    terms : derivatives (n, 6, d) of the elements by the families of system parameters.
    """

    state: State
    of_observations: Floats
    of_noise: Floats
    over_time: scipy.sparse.csr_array | None
    terms: tuple[Term, ...]

    @property
    def images(self) -> int:
        """Number of images n."""
        return len(self.of_observations)


def direct_orientations(
    gnss: GnssPositions, ins: InsAttitudes, system: Mapping[str, Floats], reading: Ints | None = None
) -> DirectOrientations:
    """Orientations of all images from their positions and attitudes.

    Parameters
    ----------
    gnss, ins : one position and one attitude of every image, all with every component.
    system : family of system parameters → (entities, components), SI and radians.
    reading : (n,) the image whose position and attitude each image has; None: each its own.

    Raises
    ------
    InconsistentBlockError : if an image lacks its position or attitude, or a component of them.
    """
    every_image = np.arange(len(gnss.event))
    if not (np.array_equal(gnss.event, every_image) and np.array_equal(ins.event, every_image)):
        raise InconsistentBlockError(
            "Direct georeferencing needs one position and one attitude of every image."
        )
    if not (gnss.stochastic.present.all() and ins.stochastic.present.all()):
        raise InconsistentBlockError("A position or an attitude lacks a component.")
    inertial_from_body = rotation.from_roll_pitch_yaw(system[BORESIGHT])[ins.camera]
    local_from_camera = ins.at_exposure(system) @ inertial_from_body @ ins.body_from_camera
    state = State(gnss.observed, local_from_camera, np.zeros((0, 3)), system)
    # The projection centre enters its equation linearly, so one correction is exact.
    correction = np.einsum("nij,nj->ni", gnss.local_from_enu, gnss.linearize(state).misclosure)
    state = replace(state, projection_centre=state.projection_centre + correction)
    position, attitude = gnss.linearize(state), ins.linearize(state)
    of_elements = np.concatenate([_of_elements(position), _of_elements(attitude)], axis=1)
    of_observations = np.asarray(np.linalg.inv(of_elements), np.float64)
    spread = np.zeros_like(of_observations)
    spread[:, :3, :3] = np.linalg.inv(gnss.stochastic.whitener)
    spread[:, 3:, 3:] = np.linalg.inv(ins.stochastic.whitener)
    terms = tuple(
        replace(term, jacobian=-of_observations @ term.jacobian) for term in _system_terms(position, attitude)
    )
    over_time = correlated_noise(gnss.stochastic, ins.stochastic, reading)
    return DirectOrientations(state, of_observations, of_observations @ spread, over_time, terms)


def _of_elements(equations: Linearization) -> Floats:
    """Derivatives (n, 3, 6) of three equations of each image by its elements."""
    return next(term.jacobian for term in equations.terms if term.block == EXTERIOR_ORIENTATION)


def _system_terms(position: Linearization, attitude: Linearization) -> tuple[Term, ...]:
    """Derivatives (n, 6, d) of all six equations by each family of system parameters."""
    stacked: dict[str, Term] = {}
    for equations, rows in ((position, slice(0, 3)), (attitude, slice(3, 6))):
        for term in equations.terms:
            if term.block == EXTERIOR_ORIENTATION:
                continue
            if term.block not in stacked:
                n, _, parameters = term.jacobian.shape
                stacked[term.block] = Term(term.block, term.index, np.zeros((n, 6, parameters)))
            stacked[term.block].jacobian[:, rows] = term.jacobian
    return tuple(stacked.values())


def correlated_noise(
    position: StochasticModel, attitude: StochasticModel, reading: Ints | None = None
) -> scipy.sparse.csr_array | None:
    """C (6 n, 6 n) with e = C w for the standardized errors of n images; None where all are independent.

    Parameters
    ----------
    position, attitude : of the positions and of the attitudes of all images, three components each;
        component k of image i has the row 6 i + k.
    reading : (n,) the image whose reading each image has; None: each its own.
    """
    n = len(position.sigma)
    draw = np.arange(n) if reading is None else reading
    if position.over_time is None and attitude.over_time is None and np.array_equal(draw, np.arange(n)):
        return None
    parts = [_triplets(model, 3 * half, draw) for half, model in enumerate((position, attitude))]
    row, column, value = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    size = 6 * n
    return scipy.sparse.csr_array(scipy.sparse.coo_array((value, (row, column)), shape=(size, size)))


def _triplets(model: StochasticModel, first: int, draw: Ints) -> tuple[Ints, Ints, Floats]:
    """Rows, columns and values of three components of every image, the first of them at 6 i + first."""
    later, earlier, value = _factor(model)
    component = first + np.arange(3)
    rows, columns = (6 * index[:, None] + component for index in (later, draw[earlier]))
    return rows.ravel(), columns.ravel(), np.repeat(value, 3)


def _factor(model: StochasticModel) -> tuple[Ints, Ints, Floats]:
    """Later image, earlier image and coefficient of every pair in a strip, an image with itself too."""
    n = len(model.sigma)
    process, neighbours = model.over_time, model.neighbours
    if process is None or neighbours is None:
        index = np.arange(n, dtype=np.int64)
        return index, index, np.ones(n)
    order = np.lexsort((process.time, process.strip))
    later, earlier = list[Ints](), list[Ints]()
    for own in np.split(order, np.flatnonzero(np.diff(process.strip[order])) + 1):
        i, j = np.tril_indices(len(own))
        later.append(own[i])
        earlier.append(own[j])
    one, other = np.concatenate(later), np.concatenate(earlier)
    age = (process.time[one] - process.time[other]) / process.correlation_time
    return one, other, np.exp(-age) * np.sqrt(neighbours.free_of_before[other])
