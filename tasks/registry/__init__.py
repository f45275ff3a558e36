"""The registry of calibrations: immutable versioned records, their approval and their validity."""
