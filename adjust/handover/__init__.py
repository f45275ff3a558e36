"""Orientations for programs that understand the world in another way, and how far they are from ours."""
