"""The system parameters of a block with calibrated values, and the covariance of these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from adjust.arrays import Ints
from adjust.block import Block
from adjust.georeferencing.error_sources import CalibrationErrors
from adjust.parameters import FAMILIES, TIME_OFFSET, SystemParameters
from tasks.errors import InputError
from tasks.georeferencing.calibration import Calibration
from tasks.nearest_name import did_you_mean
from tasks.quantities import reported_unit
from tasks.tables.covariance import Key


@dataclass(frozen=True, eq=False)
class CalibratedSystem:
    """System parameters with calibrated values.

    Attributes
    ----------
    parameters : every family of the block.
    errors : which of the values have a standard deviation, and their covariance.
    estimated : (parameter, entity) of the calibration and factor from SI, in the order of the covariance.
    flights : flight of the project → flight of the calibration whose shift and time offset it has.
    """

    parameters: tuple[SystemParameters, ...]
    errors: CalibrationErrors
    estimated: tuple[tuple[Key, float], ...]
    flights: Mapping[str, str]


@dataclass
class _Estimated:
    """Estimated parameters in the order in which they are met, with their factors from SI."""

    keys: list[Key] = field(default_factory=list)
    factors: list[float] = field(default_factory=list)

    def column(self, key: Key, factor: float) -> int:
        """Column of a parameter; flights that share a shift share its error, too."""
        if key not in self.keys:
            self.keys.append(key)
            self.factors.append(factor)
        return self.keys.index(key)


def calibrated_system(
    block: Block, calibration: Calibration, shift_of_flight: str | None
) -> CalibratedSystem:
    """The system parameters of a block whose cameras are already calibrated.

    Parameters
    ----------
    shift_of_flight : flight of the calibration whose shift and time offset hold; None: as the names say.

    Raises
    ------
    InputError
        If the flights of the calibration do not fit, or a correlation is missing.
    """
    flights = calibrated_flights(calibration, block.flights, shift_of_flight)
    families = list(block.system)
    if any(("time_offset", flight) in calibration.values for flight in flights.values()):
        nothing = np.zeros((len(block.flights), 1))
        families.append(SystemParameters(FAMILIES[TIME_OFFSET], block.flights, nothing, nothing != 0.0))
    estimated, columns = _Estimated(), dict[str, Ints]()
    system = []
    for parameters in families:
        name = parameters.family.name
        filled, columns[name] = _filled(parameters, calibration, flights, estimated)
        system.append(filled)
    scale = np.array(estimated.factors)
    covariance = calibration.covariance(estimated.keys) / np.outer(scale, scale)
    return CalibratedSystem(
        tuple(system),
        CalibrationErrors(columns, covariance),
        tuple(zip(estimated.keys, estimated.factors, strict=True)),
        flights,
    )


def _filled(
    parameters: SystemParameters, calibration: Calibration, flights: Mapping[str, str], estimated: _Estimated
) -> tuple[SystemParameters, Ints]:
    """One family with its calibrated values in SI, and the column of each in the covariance."""
    family, values = parameters.family, parameters.values.copy()
    column = np.full(values.shape, -1, dtype=np.int64)
    if family.entity_kind == "strip":  # they stay behind with the flight that was calibrated
        return parameters, column
    for entity, component in np.ndindex(values.shape):
        quantity = parameters.quantity(entity, component)
        of_flight = family.entity_kind == "flight"
        key = (quantity.name, flights.get(quantity.entity, "") if of_flight else quantity.entity)
        if key not in calibration.values:
            continue
        factor = reported_unit(family, component)[1]
        values[entity, component] = calibration.values[key] / factor
        if key in calibration.sigmas:
            column[entity, component] = estimated.column(key, factor)
    return replace(parameters, values=values), column


def calibrated_flights(
    calibration: Calibration, flights: tuple[str, ...], shift_of_flight: str | None
) -> dict[str, str]:
    """For each flight, the flight of the calibration whose shift and time offset apply; empty without any.

    Raises
    ------
    InputError
        If there are several and none of them is meant, or one is named and there is none.
    """
    known = tuple(dict.fromkeys(calibration.entities("gnss_shift_x") + calibration.entities("time_offset")))
    if shift_of_flight is not None and not known:
        raise InputError(
            f"The GNSS shift of the flight '{shift_of_flight}' is to be used, but the calibration has none "
            "of any flight.",
            "Leave shift_of_flight out, or name another calibration.",
            entity="direct_georeferencing.shift_of_flight",
        )
    found = {}
    for flight in flights if known else ():
        wanted = flight if shift_of_flight is None else shift_of_flight
        if wanted not in known and (shift_of_flight is not None or len(known) > 1):
            raise InputError(
                f"The calibration has no GNSS shift for the flight '{wanted}'.",
                f"{did_you_mean(wanted, known)} Specify which one to use.",
                entity="direct_georeferencing.shift_of_flight",
            )
        found[flight] = wanted if wanted in known else known[0]
    return found
