"""Artifacts and where they are kept: digests, keys, the stage store, the manifest, one run at a time."""
