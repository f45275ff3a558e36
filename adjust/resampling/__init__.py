"""Images resampled through a map of their pixels."""
