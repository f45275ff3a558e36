"""Orientations for programs with another model of the world, and their differences from ours."""
