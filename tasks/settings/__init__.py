"""The project file: every key with its unit, default and meaning."""
