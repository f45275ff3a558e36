"""Accuracy statements according to published standards."""
