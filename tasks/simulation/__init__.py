"""Simulated blocks as ordinary projects with their truth, and the presets."""
