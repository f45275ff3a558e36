"""What Prefect's dashboard shows of a run: a short text that links to the production page."""
