"""Rotations, the earth and the local frames in which the adjustment is Cartesian."""
