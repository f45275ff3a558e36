"""The page of the time series of calibrations."""
