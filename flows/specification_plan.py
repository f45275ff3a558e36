"""A calibration plan of a specification: what a flight will determine that nobody has flown."""

from __future__ import annotations

from pathlib import Path

from tasks.planning.plan import CalibrationPlan, plan_calibration
from tasks.planning.request import PlanRequest
from tasks.planning.simulated_plan import network_of_specification
from tasks.settings.adjustment import AdjustmentSettings, FreeParameter
from tasks.settings.calibration import CalibrationSettings
from tasks.settings.load_simulation import load_simulation


def plan_of_specification(
    source: str,
    overrides: tuple[str, ...] = (),
    _data: Path | None = None,
    *,
    free: tuple[FreeParameter, ...] | None = None,
    additional: str | None = None,
    strip_bias_m: float | None = None,
    propose: bool = True,
) -> CalibrationPlan:
    """Plan the flight of a preset or a SPEC.toml.

    Raises
    ------
    InputError, NotComputableError
        If the specification is wrong or its block determines nothing.
    """
    simulation = load_simulation(source, overrides)
    calibration = simulation.calibration or CalibrationSettings()
    request = PlanRequest.of(calibration, AdjustmentSettings(), free, additional, strip_bias_m)
    network = network_of_specification(simulation)
    return plan_calibration(simulation.project.name, network, request, propose=propose)
