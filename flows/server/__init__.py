"""The parts of a server: Prefect's processes, who may ask them, the inbox and what watches it."""
