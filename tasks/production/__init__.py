"""The records of production: every run of a story, its state, figures and notices."""
