"""Artifacts and their storage: digests, keys, the stage store, the manifest, the lock of a run."""
