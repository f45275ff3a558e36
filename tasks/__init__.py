"""The stages of a project: one verb each, reading artifacts, adjusting, writing artifacts."""
