"""Observation types: one file each, with the condition that is zero when the observation is satisfied."""
