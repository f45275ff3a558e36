"""One file for each stage of a run: what it reads, computes and writes into its folder of the store."""
