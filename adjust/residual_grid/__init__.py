"""Grids of image residuals: computation, choice, iteration, smoothing and tests."""
