"""The Parquet contracts, and reading and writing tables that keep them."""
