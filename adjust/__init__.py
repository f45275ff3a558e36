"""Adjustment of aerial blocks: the mathematics, free of files and frameworks."""
