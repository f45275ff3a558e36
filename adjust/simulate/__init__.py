"""Simulation: blocks with known truth, measured with known noise."""
