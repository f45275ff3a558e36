"""The registry of calibrations: immutable versioned records, who approved them, and from when they hold."""
