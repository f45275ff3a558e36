"""Simulated blocks as ordinary projects with true values, and the presets."""
