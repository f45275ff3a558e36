"""Contents of the results folder of a run: summary, gates, manifest, and their retention."""
