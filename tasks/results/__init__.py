"""What a run leaves in its results folder: summary, gates, manifest, and what is kept."""
