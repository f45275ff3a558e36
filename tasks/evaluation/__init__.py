"""Evaluation of an adjustment: figures and tables of residuals, parameters, precision and model tests."""
