"""Benchmarks: this adjustment beside COLMAP's, its growth with the block, and its start-up times."""
