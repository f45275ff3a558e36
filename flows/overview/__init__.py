"""The production page: every project with its stages and gates, trends, calibrations, queue and failures."""
