"""Covariances of the system parameters before anything is measured.

The normal equations are those of the adjustment, linearised at the planned geometry; the a-priori σ0 is 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats
from adjust.block import Block
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.observations.base import ObservationGroup, StochasticModel
from adjust.observations.control_point import ControlPoints
from adjust.observations.direct import DirectObservations
from adjust.observations.distance import Distances
from adjust.observations.gauss_markov import GaussMarkov
from adjust.observations.gnss_position import GnssPositions, StripMotion
from adjust.observations.image_point import ImagePoints
from adjust.observations.ins_attitude import BodyRates, InsAttitudes
from adjust.one_thread import one_thread
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    FAMILIES,
    SystemParameters,
    free_in_rig,
)
from adjust.planning.network import PlannedDistances, PlannedNetwork
from adjust.rig import OF_HEADS
from adjust.selection.correlation import correlation_matrix, total_correlation
from adjust.solve.defect import explain_defect
from adjust.solve.factorization import SingularNormalsError, factorize
from adjust.solve.normal_equations import reduced_normals
from adjust.solve.system import Observations, System

# Points with narrower rays (this from their mean, twice as much between two) are used by no adjustment.
_LEAST_ANGLE = np.deg2rad(0.5)


@dataclass(frozen=True, eq=False)
class PlannedAdditional:
    """Additional parameters to be estimated, all of them zero before.

    Attributes
    ----------
    model : which parameters each exposure has.
    parameters : which are free.
    prior : what is known of them beforehand; None: nothing.
    """

    model: SelfCalibration
    parameters: SystemParameters
    prior: DirectObservations | None


@dataclass(frozen=True, eq=False)
class CalibrationModel:
    """The estimated parameters, and their prior knowledge.

    Attributes
    ----------
    free : family → components that are unknown.
    prior_sigma : family → (d,) standard deviations of its given values, SI and radians; NaN for none.
    gnss_correlation_time, ins_correlation_time : seconds that the errors of positions and attitudes last
        along a strip; None: they are independent.
    additional : additional parameters of the cameras; None without any.
    """

    free: Mapping[str, tuple[int, ...]]
    prior_sigma: Mapping[str, Floats]
    gnss_correlation_time: float | None = None
    ins_correlation_time: float | None = None
    additional: PlannedAdditional | None = None


@dataclass(frozen=True, eq=False)
class APriori:
    """Covariances of the g free system parameters, everything else eliminated; σ0 = 1.

    Attributes
    ----------
    names : (parameter, entity, SI unit) of each.
    value : (g,) at which the equations were linearised, SI and radians.
    cofactor : (g, g).
    prior_sigma : (g,) NaN where there is no prior.
    """

    names: tuple[tuple[str, str, str], ...]
    value: Floats
    cofactor: Floats
    prior_sigma: Floats

    @property
    def sigma(self) -> Floats:
        """(g,) standard deviations."""
        return np.sqrt(np.diagonal(self.cofactor))

    @property
    def correlation(self) -> Floats:
        """(g, g)."""
        return correlation_matrix(self.cofactor)

    @property
    def own_part(self) -> Floats:
        """(g,) 1 − R² of each with all others."""
        return np.asarray(1.0 - total_correlation(self.cofactor) ** 2)


def a_priori_covariance(network: PlannedNetwork, model: CalibrationModel, threads: int = 1) -> APriori:
    """Expected covariances of the system parameters of a network.

    Raises
    ------
    DatumDefectError : it does not determine them, with the directions that are open.
    InconsistentBlockError : the network contradicts itself.
    """
    network = network.with_intersecting_rays(_LEAST_ANGLE)
    block = _block(network, model)
    with one_thread():
        system = System.of(block, _observations(network, block, model), threads)
        state = block.approximate_state()
        normals = reduced_normals(system, state)
        try:
            normal = factorize(normals, threads).factor.border_normal()
        except SingularNormalsError as error:
            raise explain_defect(system, state, error) from error
        g = system.layout.border
        cofactor = _inverse(normal)[:g, :g]
    value, sigma = np.zeros(g), np.full(g, np.nan)
    for parameters in block.system:
        columns = system.layout.columns[parameters.family.name]
        free = columns >= 0
        value[columns[free]] = parameters.values[free]
        known = _prior_sigma(model, parameters.family.name)
        if known is not None:
            sigma[columns[free]] = np.broadcast_to(known, columns.shape)[free]
    return APriori(system.layout.border_names(), value, cofactor, sigma)


def _prior_sigma(model: CalibrationModel, family: str) -> Floats | None:
    """Standard deviations (e, d) or (d,) of what is known of a family beforehand; NaN where nothing is."""
    if family != ADDITIONAL_PARAMETERS:
        return model.prior_sigma.get(family)
    prior = None if model.additional is None else model.additional.prior
    return None if prior is None else prior.stochastic.sigma


def _inverse(normal: Floats) -> Floats:
    """N⁻¹ by way of the matrix with a unit diagonal: metres and radians differ by powers of ten."""
    scale = 1.0 / np.sqrt(np.diagonal(normal))
    inverse = np.linalg.inv(normal * scale[:, None] * scale)
    return np.asarray(0.5 * (inverse + inverse.T) * scale[:, None] * scale)


def _block(network: PlannedNetwork, model: CalibrationModel) -> Block:
    exposures, rig = network.exposures, network.rig
    entities = {
        "camera": tuple(camera.name for camera in network.cameras),
        "flight": network.flights,
        "strip": network.strips,
    }
    system = []
    for family in FAMILIES.values():
        components = model.free.get(family.name, ())
        of_heads = rig is not None and family.name in OF_HEADS
        if not (family.always_there or components or of_heads):
            continue
        names = entities[family.entity_kind]
        shape = (len(names), len(family.components))
        free = np.zeros(shape, dtype=bool)
        free[:, list(components)] = True
        if rig is not None and family.entity_kind == "camera":
            free = free_in_rig(rig, family.name, free)
        system.append(SystemParameters(family, names, network.system.get(family.name, np.zeros(shape)), free))
    if model.additional is not None:
        system.append(model.additional.parameters)
    return Block(
        network.frame,
        network.cameras,
        _numbered("I", len(network.event_of_image)),
        network.camera_of_image,
        network.flights,
        exposures.flight[network.event_of_image],
        _numbered("P", len(network.object_point)),
        tuple(system),
        exposures.projection_centre,
        exposures.local_from_camera,
        network.object_point,
        rig=rig,
    )


def _numbered(prefix: str, count: int) -> tuple[str, ...]:
    return tuple(f"{prefix}{number}" for number in range(count))


def _observations(network: PlannedNetwork, block: Block, model: CalibrationModel) -> Observations:
    """Errorless observations with the weights of the plan."""
    rays, exposures, control = network.rays, network.exposures, network.control
    image_points = ImagePoints(
        rays.image,
        rays.point,
        network.camera_of_image,
        network.image_coordinates,
        rays.sigma,
        np.ones(len(rays.image), dtype=bool),
        self_calibration=None if model.additional is None else model.additional.model,
        event_of_image=None if network.rig is None else network.rig.event_of_image,
    )
    others: list[ObservationGroup] = []
    if len(control.point):
        surveyed = network.object_point[control.point]
        weights = StochasticModel.from_covariance(control.covariance, control.present)
        others.append(
            ControlPoints(control.point, surveyed, network.frame.height(surveyed), network.frame, weights)
        )
    if network.distances is not None:
        others.append(_distances(network.object_point, network.distances))
    if network.has_positions:
        others.append(_positions(network, block, model))
    if exposures.attitude_observed.any():
        others.append(_attitudes(network, block, model))
    if model.additional is not None and model.additional.prior is not None:
        others.append(model.additional.prior)
    return Observations(image_points, (*others, *_priors(block, model)))


def _distances(object_point: Floats, planned: PlannedDistances) -> Distances:
    between = object_point[planned.other_point] - object_point[planned.point]
    weights = StochasticModel.from_sigma(planned.sigma[:, None])
    return Distances(planned.point, planned.other_point, np.linalg.norm(between, axis=1), weights)


def _positions(network: PlannedNetwork, block: Block, model: CalibrationModel) -> GnssPositions:
    exposures = network.exposures
    return GnssPositions(
        np.arange(len(exposures), dtype=np.int64),
        exposures.camera,
        exposures.flight,
        network.antenna,
        exposures.local_from_axes,
        block.body_from_camera,
        _over_time(
            StochasticModel.from_sigma(exposures.position_sigma),
            network,
            np.arange(len(exposures)),
            model.gnss_correlation_time,
        ),
        _motion(network),
    )


def _attitudes(network: PlannedNetwork, block: Block, model: CalibrationModel) -> InsAttitudes:
    exposures = network.exposures
    rows = np.flatnonzero(exposures.attitude_observed)
    weights = StochasticModel.from_covariance(
        exposures.attitude_covariance[rows], np.ones((len(rows), 3), dtype=bool)
    )
    return InsAttitudes(
        rows.astype(np.int64),
        exposures.camera[rows],
        network.local_from_body[rows],
        block.body_from_camera[rows],
        _over_time(weights, network, rows, model.ins_correlation_time),
        BodyRates(exposures.flight[rows], exposures.rate[rows]),
        _motion(network).of(rows),
    )


def _motion(network: PlannedNetwork) -> StripMotion:
    exposures = network.exposures
    since = _since_middle(exposures.time, exposures.strip)
    return StripMotion(exposures.strip, since, exposures.velocity)


def _over_time(
    weights: StochasticModel, network: PlannedNetwork, rows: np.ndarray, seconds: float | None
) -> StochasticModel:
    if seconds is None:
        return weights
    return weights.correlated(
        GaussMarkov(network.exposures.strip[rows], network.exposures.time[rows], seconds)
    )


def _since_middle(time: Floats, strip: np.ndarray) -> Floats:
    """Seconds (n,) since the middle of the time span of each exposure's strip."""
    middle = np.zeros(int(strip.max()) + 1)
    for number in np.unique(strip):
        own = time[strip == number]
        middle[number] = 0.5 * (own.min() + own.max())
    return np.asarray(time - middle[strip])


def _priors(block: Block, model: CalibrationModel) -> list[DirectObservations]:
    groups = []
    for parameters in block.system:
        known = model.prior_sigma.get(parameters.family.name)
        if known is None:
            continue
        sigma = np.where(parameters.free, known, np.nan)
        if np.isfinite(sigma).any():
            entities = np.arange(len(parameters.entities), dtype=np.int64)
            weights = StochasticModel.from_sigma(sigma)
            groups.append(DirectObservations(parameters.family, entities, parameters.values, weights))
    return groups
