"""Ports for servers of tests."""

from __future__ import annotations

import socket


def free_port(host: str) -> int:
    """A port of this host that is free at the moment."""
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as trial:
        trial.bind((host, 0))
        return int(trial.getsockname()[1])
