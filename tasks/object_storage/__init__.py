"""Results on S3-compatible object storage: addresses, transfers that outlast outages, what lies where."""
