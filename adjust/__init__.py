"""Adjustment of aerial blocks: the mathematics, free of files and frameworks.

Start with :func:`adjust_block`: it takes a block and its observations, and returns adjusted values with
their covariances, redundancy numbers and tests. All values are in SI units and radians; frames and signs
are described in ``docs/conventions.md``.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from adjust.adjustment import adjust_block
    from adjust.block import Block
    from adjust.camera.additional.self_calibration import self_calibration
    from adjust.camera.interior import FrameCamera
    from adjust.errors import (
        AdditionalParametersError,
        AdjustmentError,
        DatumDefectError,
        DivergenceError,
        InconsistentBlockError,
        MissingExtraError,
        UnknownNameError,
    )
    from adjust.geometry.earth import CartesianFrame, TopocentricFrame
    from adjust.joint_covariance import JointCovariance
    from adjust.observations.base import ObservationGroup, StochasticModel
    from adjust.observations.control_point import ControlPoints
    from adjust.observations.direct import DirectObservations
    from adjust.observations.distance import Distances
    from adjust.observations.gnss_position import GnssPositions
    from adjust.observations.image_point import ImagePoints
    from adjust.observations.ins_attitude import InsAttitudes
    from adjust.options import AdjustmentOptions
    from adjust.parameters import FAMILIES, State, SystemParameters
    from adjust.result import AdjustmentResult
    from adjust.solve.system import Observations

__all__ = [
    "FAMILIES",
    "AdditionalParametersError",
    "AdjustmentError",
    "AdjustmentOptions",
    "AdjustmentResult",
    "Block",
    "CartesianFrame",
    "ControlPoints",
    "DatumDefectError",
    "DirectObservations",
    "Distances",
    "DivergenceError",
    "FrameCamera",
    "GnssPositions",
    "ImagePoints",
    "InconsistentBlockError",
    "InsAttitudes",
    "JointCovariance",
    "MissingExtraError",
    "ObservationGroup",
    "Observations",
    "State",
    "StochasticModel",
    "SystemParameters",
    "TopocentricFrame",
    "UnknownNameError",
    "adjust_block",
    "self_calibration",
]

_MODULES = {
    "AdditionalParametersError": "adjust.errors",
    "AdjustmentError": "adjust.errors",
    "AdjustmentOptions": "adjust.options",
    "AdjustmentResult": "adjust.result",
    "Block": "adjust.block",
    "CartesianFrame": "adjust.geometry.earth",
    "ControlPoints": "adjust.observations.control_point",
    "DatumDefectError": "adjust.errors",
    "DirectObservations": "adjust.observations.direct",
    "Distances": "adjust.observations.distance",
    "DivergenceError": "adjust.errors",
    "FAMILIES": "adjust.parameters",
    "FrameCamera": "adjust.camera.interior",
    "GnssPositions": "adjust.observations.gnss_position",
    "ImagePoints": "adjust.observations.image_point",
    "InconsistentBlockError": "adjust.errors",
    "InsAttitudes": "adjust.observations.ins_attitude",
    "JointCovariance": "adjust.joint_covariance",
    "MissingExtraError": "adjust.errors",
    "ObservationGroup": "adjust.observations.base",
    "Observations": "adjust.solve.system",
    "State": "adjust.parameters",
    "StochasticModel": "adjust.observations.base",
    "SystemParameters": "adjust.parameters",
    "TopocentricFrame": "adjust.geometry.earth",
    "UnknownNameError": "adjust.errors",
    "adjust_block": "adjust.adjustment",
    "self_calibration": "adjust.camera.additional.self_calibration",
}


def __getattr__(name: str) -> object:
    """A name of the list above, loaded when it is requested: who needs one module waits for no other."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)
