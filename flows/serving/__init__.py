"""Flows under Prefect: registered, deployed, and ``aerocal serve``, which runs them on one machine."""
