"""One file for each stage of a run: its inputs, computation and outputs."""
