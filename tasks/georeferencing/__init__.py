"""The direct-georeferencing check: from tables to its figures, and back to tables."""
