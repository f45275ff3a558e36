"""Approximate values of the unknowns."""
