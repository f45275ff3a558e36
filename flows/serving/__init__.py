"""``aerocal serve``: Prefect's server, the deployments and the runner on one machine."""
