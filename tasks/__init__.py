"""The stages of a project: each reads artifacts, computes, and writes artifacts."""
