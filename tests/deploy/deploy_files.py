"""What stands in deploy/, read as the tools that use it read it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import yaml

REPOSITORY = Path(__file__).resolve().parents[2]
DEPLOY = REPOSITORY / "deploy"


def compose() -> dict[str, Any]:
    return dict(yaml.safe_load((DEPLOY / "compose.yaml").read_text()))


def kubernetes(kind: str) -> dict[str, Any]:
    """The one object of a kind."""
    objects = yaml.safe_load_all((DEPLOY / "kubernetes" / "aerocal.yaml").read_text())
    (found,) = [one for one in objects if one["kind"] == kind]
    return dict(found)


def served_by() -> dict[str, list[str]]:
    """Where ``aerocal`` is started, and with which arguments."""
    (container,) = kubernetes("Deployment")["spec"]["template"]["spec"]["containers"]
    unit = (DEPLOY / "systemd" / "aerocal.service").read_text().splitlines()
    (start,) = [line.removeprefix("ExecStart=") for line in unit if line.startswith("ExecStart=")]
    services = compose()["services"]
    ours = {
        name: one["command"] for name, one in services.items() if one.get("image", "").startswith("aerocal:")
    }
    return {**ours, "kubernetes": container["args"], "systemd": shlex.split(start)[1:]}


def prefect_deployments() -> list[dict[str, Any]]:
    return list(yaml.safe_load((DEPLOY / "prefect.yaml").read_text())["deployments"])
