"""Observation types: one file each, saying what is zero when the observation is satisfied."""
