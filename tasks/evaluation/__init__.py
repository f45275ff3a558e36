"""What an adjustment shows: figures and tables of residuals, parameters, precision and model tests."""
