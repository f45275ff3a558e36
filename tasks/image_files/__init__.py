"""Images read in windows: metadata, pixels, and which of them are valid."""
