"""Input files, JSON, and the capabilities of the installation."""
