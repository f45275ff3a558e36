"""Plausibility of delivered data, and the mistake that would explain a contradiction."""
