"""Calibration from adjusted and observed orientations: mountings, boresight, lever arm, shift."""
