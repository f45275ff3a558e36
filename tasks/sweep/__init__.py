"""Comparison of scenarios: sub-blocks, choices of control points, one table, one page."""
