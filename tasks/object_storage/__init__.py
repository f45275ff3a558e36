"""Results on S3-compatible object storage: addresses, transfers that survive outages, layout."""
