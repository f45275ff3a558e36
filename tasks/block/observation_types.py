"""Types of observations besides image points: how each makes its groups from the delivered tables.

The mathematics of a type is in `adjust.observations`; the adjustment takes the groups of all `TYPES`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from adjust.block import Block
from adjust.observations.base import ObservationGroup, StochasticModel
from adjust.observations.control_point import ControlPoints
from adjust.observations.direct import DirectObservations
from adjust.observations.distance import Distances
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.ins_attitude import BodyRates, InsAttitudes
from adjust.parameters import FAMILIES
from tasks.block.block_input import SurveyedPoints
from tasks.block.given_orientations import GivenOrientations
from tasks.block.self_calibration import BlockSelfCalibration
from tasks.block.shared_readings import heads_of_reading
from tasks.block.strip_motion import over_time, strip_motion
from tasks.quantities import KINDS, reported_unit
from tasks.settings.adjustment import AdjustmentSettings, Priors
from tasks.tables.places import places_of


@dataclass(frozen=True, eq=False)
class Observed:
    """What groups of observations are made from.

    Attributes
    ----------
    block : with names, cameras and approximate values in the local frame.
    events : given positions and attitudes of its events.
    surveyed : control and check points.
    distances : distances.parquet.
    calibration : additional parameters; None: none are estimated.
    """

    block: Block
    events: GivenOrientations
    surveyed: SurveyedPoints
    distances: pd.DataFrame
    settings: AdjustmentSettings
    calibration: BlockSelfCalibration | None = None

    def groups(self) -> tuple[ObservationGroup, ...]:
        """The groups of all types."""
        return tuple(group for make in TYPES for group in make(self))


def gnss_positions(block: Block, given: GivenOrientations, settings: AdjustmentSettings) -> GnssPositions:
    """GNSS positions of the images or events that have one, along grid axes; heads share a reading."""
    observed = np.flatnonzero(given.position_observed)
    heads = heads_of_reading(given)[observed]
    model = _shared(StochasticModel.from_sigma(given.position_sigma[observed]), heads)
    return GnssPositions(
        observed.astype(np.int64),
        given.camera[observed],
        block.flight_of_event[observed],
        given.observed[observed],
        given.local_from_grid[observed],
        given.body_from_camera[observed],
        over_time(model, given, observed, settings.gnss_correlation_s),
        strip_motion(given).of(observed),
    )


def ins_attitudes(given: GivenOrientations, settings: AdjustmentSettings) -> InsAttitudes:
    """INS attitudes of the images or events that have one, weighted in body axes; heads share a reading."""
    observed = np.flatnonzero(given.attitude_observed)
    covariance, heads = given.attitude_covariance()[observed], heads_of_reading(given)[observed]
    model = StochasticModel.from_covariance(covariance, np.ones((len(observed), 3), dtype=bool))
    model = _shared(model, heads)
    return InsAttitudes(
        observed.astype(np.int64),
        given.camera[observed],
        given.local_from_body()[observed],
        given.body_from_camera[observed],
        over_time(model, given, observed, settings.ins_correlation_s),
        _body_rates(given, observed),
        strip_motion(given).of(observed),
    )


def _shared(model: StochasticModel, heads: Ints) -> StochasticModel:
    """Weights with which readings of several heads (n,) count once: with larger σ, each a part of one."""
    if (heads == 1).all():
        return model
    return replace(model.rescaled(np.sqrt(heads)[:, None]), share=1.0 / heads)


def _body_rates(given: GivenOrientations, rows: Ints) -> BodyRates | None:
    """Rates of some images (k,); None where none was delivered."""
    rate = given.rates[rows]
    if not np.isfinite(rate).any():
        return None
    return BodyRates(given.flight_of_image[rows], np.nan_to_num(rate))


def _control_points(observed: Observed) -> Iterator[ControlPoints]:
    """Control points that are object points of the block."""
    block, surveyed = observed.block, observed.surveyed
    kept, index = surveyed.control_among(block.points)
    if "control" in observed.settings.observe and len(kept):
        yield ControlPoints(
            index,
            surveyed.x_in_local[kept],
            surveyed.height[kept],
            block.frame,
            StochasticModel.from_covariance(surveyed.covariance[kept], surveyed.present[kept]),
        )


def _gnss(observed: Observed) -> Iterator[GnssPositions]:
    if "gnss" in observed.settings.observe and observed.events.position_observed.any():
        yield gnss_positions(observed.block, observed.events, observed.settings)


def _ins(observed: Observed) -> Iterator[InsAttitudes]:
    if "ins" in observed.settings.observe and observed.events.attitude_observed.any():
        yield ins_attitudes(observed.events, observed.settings)


def _distances(observed: Observed) -> Iterator[Distances]:
    """Distances between object points of the block; those of the role check are not used."""
    table, block = observed.distances, observed.block
    ends = np.stack([places_of(table[name], block.points) for name in ("point", "other_point")])
    kept = np.flatnonzero((ends >= 0).all(axis=0))
    if len(kept):
        own = table.iloc[kept]
        model = StochasticModel.from_sigma(own[["sigma_m"]].to_numpy(np.float64))
        check = (own["role"] == "check").to_numpy()
        point, other = ends[:, kept]
        yield Distances(point, other, own["distance_m"].to_numpy(np.float64), model.without(check))


def prior_sigmas(given: Priors) -> dict[str, Floats]:
    """Standard deviations (components,) of the given values of every family, SI and radians; NaN for none."""
    sigmas = {name: np.full(len(family.components), np.nan) for name, family in FAMILIES.items()}
    for kind in KINDS.values():
        own = getattr(given, kind.key(kind.unit), None)
        if own is not None:
            factor = reported_unit(FAMILIES[kind.family])[1]
            sigmas[kind.family][list(kind.components)] = np.array(own) / factor
    return sigmas


def _priors(observed: Observed) -> Iterator[DirectObservations]:
    """The free parameters whose given value has a standard deviation."""
    sigmas = prior_sigmas(observed.settings.priors)
    for parameters in observed.block.system:
        if parameters.family.name not in sigmas:
            continue
        sigma = np.where(parameters.free, sigmas[parameters.family.name], np.nan)
        if np.isfinite(sigma).any():
            yield DirectObservations(
                parameters.family,
                np.arange(len(parameters.entities), dtype=np.int64),
                parameters.values,
                StochasticModel.from_sigma(sigma),
            )


def _additional_parameters(observed: Observed) -> Iterator[DirectObservations]:
    """The additional parameters, where the settings give the size of their effect."""
    if observed.calibration is not None:
        prior = observed.calibration.prior(observed.settings.self_calibration.sigma_um)
        if prior is not None:
            yield prior


#: All types, in the order of their groups. A new one is a function of `Observed`, and a line here.
TYPES: tuple[Callable[[Observed], Iterable[ObservationGroup]], ...] = (
    _control_points,
    _gnss,
    _ins,
    _priors,
    _additional_parameters,
    _distances,
)
