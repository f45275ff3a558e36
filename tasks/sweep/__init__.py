"""Scenarios side by side: sub-blocks, choices of control points, one table, one page."""
