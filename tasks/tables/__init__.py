"""The Parquet schemas, and reading and writing tables that conform to them."""
