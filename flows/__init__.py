"""The stories: which stages, in which order."""
