"""The values that were applied, as a table."""

from __future__ import annotations

from tasks.files.json_text import JSON
from tasks.georeferencing.calibration import Calibration
from tasks.georeferencing.directly_oriented import DirectlyOriented
from tasks.quantities import is_calibrated


def applied_parameters(oriented: DirectlyOriented, calibration: Calibration) -> list[JSON]:
    """Parameter, entity, value, σ (null: taken to be free of error) and unit of everything that was applied.

    Biases and drifts of the calibration's own strips are not.
    """
    entities = {*oriented.given.mountings.names, *oriented.flights.values()}
    return [
        {
            "parameter": parameter,
            "entity": entity,
            "value": value,
            "sigma": calibration.sigmas.get((parameter, entity)),
            "unit": calibration.units[parameter, entity],
            "status": calibration.statuses[parameter, entity],
        }
        for (parameter, entity), value in calibration.values.items()
        if entity in entities and is_calibrated(parameter)
    ]
