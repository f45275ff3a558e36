"""Simulation: blocks with known truth, measured with known noise."""

from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.flight_plan import LineGroup, base_of, spacing_of
from adjust.simulate.noise import NoiseSpecification
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout
from adjust.simulate.system import SystemSpecification
from adjust.simulate.terrain import TerrainShape
from adjust.simulate.truth import BlockSpecification

__all__ = [
    "BlockSpecification",
    "LineGroup",
    "NoiseSpecification",
    "PointSpecification",
    "SimulatedBlock",
    "SurveyLayout",
    "SystemSpecification",
    "TerrainShape",
    "base_of",
    "simulate_block",
    "spacing_of",
]
