"""A calibration plan: what a flight will determine that has not been flown or adjusted yet."""

from __future__ import annotations

import tempfile
from pathlib import Path

from flows.stories.block_preparation import prepare_block
from tasks.block.assembled_block import DeliveredTables
from tasks.georeferencing.registered_cameras import with_registered_cameras
from tasks.planning.network import network_of_project, network_of_specification
from tasks.planning.plan import CalibrationPlan, plan_calibration
from tasks.planning.request import PlanRequest
from tasks.settings.adjustment import AdjustmentSettings, FreeParameter
from tasks.settings.calibration import CalibrationSettings
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.store.store import Store


def plan_of_project(
    source: str,
    overrides: tuple[str, ...] = (),
    data: Path | None = None,
    *,
    free: tuple[FreeParameter, ...] | None = None,
    additional: str | None = None,
    strip_bias_m: float | None = None,
    propose: bool = True,
) -> CalibrationPlan:
    """Plan with a project: its orientations as given, its image points and control, nothing adjusted.

    Raises
    ------
    InputError, NotComputableError
        If the project is wrong or its block determines nothing.
    """
    project = with_registered_cameras(load_project(Path(source), overrides, data))
    settings = project.adjustment
    request = PlanRequest.of(project.calibration, settings, free, additional, strip_bias_m)
    # A plan leaves nothing behind.
    with tempfile.TemporaryDirectory(prefix="aerocal-plan-") as folder:
        store = Store.of(Path(folder))
        store.begin_run()
        block = prepare_block(project, store)
        delivered = DeliveredTables.of(block.start)
        network = network_of_project(delivered, project.project, settings, request.estimated)
    return plan_calibration(project.project.name, network, request, propose=propose)


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
