"""The page of a direct-georeferencing check."""
