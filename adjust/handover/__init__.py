"""Orientations for programs that understand the world in another way, and how far those then are from ours."""
