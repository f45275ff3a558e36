"""Images, read in windows: what a file says about itself, its pixels, and which of them are valid."""
