"""Files as they are delivered, JSON, and what the installation can do."""
