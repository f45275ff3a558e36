"""Execution of a flow: request, stages, workers, clusters, and the record of a run."""
