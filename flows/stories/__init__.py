"""The flows as plain functions: which stages, in which order."""
