"""The network of a specification: a flight plan with its terrain, control and standard deviations."""

from __future__ import annotations

from adjust.errors import InconsistentBlockError
from adjust.planning.network import PlannedNetwork
from adjust.planning.simulated_network import simulated_network
from tasks.errors import InputError
from tasks.settings.simulation import Simulation
from tasks.simulation.simulation_input import block_specification


def network_of_specification(simulation: Simulation) -> PlannedNetwork:
    """The network that a specification would give; no measurement is simulated.

    Raises
    ------
    InputError
        If the settings give no block.
    """
    try:
        return simulated_network(block_specification(simulation))
    except InconsistentBlockError as error:
        raise InputError(str(error), "Change [flight] or [points].") from error
