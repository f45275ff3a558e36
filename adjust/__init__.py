"""Adjustment of aerial blocks: the mathematics, free of files and frameworks.

A block and its observations go into :func:`adjust_block`; what comes out knows how good it is.
Everything is SI and radians; ``docs/conventions.md`` of the repository has frames and signs.
"""

from adjust.adjustment import adjust_block
from adjust.block import Block
from adjust.camera.interior import FrameCamera
from adjust.errors import (
    AdjustmentError,
    DatumDefectError,
    DivergenceError,
    InconsistentBlockError,
)
from adjust.observations.base import ObservationGroup, StochasticModel
from adjust.observations.control_point import ControlPoints
from adjust.observations.direct import DirectObservations
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.image_point import ImagePoints
from adjust.observations.ins_attitude import InsAttitudes
from adjust.options import AdjustmentOptions
from adjust.parameters import FAMILIES, State, SystemParameters
from adjust.result import AdjustmentResult
from adjust.solve.system import Observations

__all__ = [
    "FAMILIES",
    "AdjustmentError",
    "AdjustmentOptions",
    "AdjustmentResult",
    "Block",
    "ControlPoints",
    "DatumDefectError",
    "DirectObservations",
    "DivergenceError",
    "FrameCamera",
    "GnssPositions",
    "ImagePoints",
    "InconsistentBlockError",
    "InsAttitudes",
    "ObservationGroup",
    "Observations",
    "State",
    "StochasticModel",
    "SystemParameters",
    "adjust_block",
]
