"""Parts of the server: Prefect's processes, access control, the inbox and its monitoring."""
