"""What stands in deploy/ fits this aerocal; `make deploy-lint` holds it to the schemas of its tools."""

from __future__ import annotations

import re
import tomllib
from importlib import import_module

import pytest

from tests.command_line import aerocal
from tests.deploy.deploy_files import DEPLOY, REPOSITORY, compose, kubernetes, prefect_deployments, served_by

PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]


@pytest.mark.parametrize("place", served_by())
def test_the_command_line_knows_every_option(place: str) -> None:
    command, *arguments = served_by()[place]
    shown = aerocal(command, "--help").stdout
    options = {argument.split("=")[0] for argument in arguments if argument.startswith("--")}
    assert options
    assert not [option for option in sorted(options) if not re.search(rf"{option}\b", shown)]


def test_images_carry_the_version_of_the_project() -> None:
    named = [one["image"] for one in compose()["services"].values()]
    (container,) = kubernetes("Deployment")["spec"]["template"]["spec"]["containers"]
    ours = {name for name in (*named, container["image"]) if name.startswith("aerocal:")}
    assert ours == {f"aerocal:{PROJECT['version']}"}
    assert not [name for name in named if name.endswith(":latest") or ":" not in name]


def test_the_image_copies_what_there_is_and_all_of_it() -> None:
    lines = (DEPLOY / "Dockerfile").read_text().splitlines()
    copied = [line.split()[1:-1] for line in lines if line.startswith("COPY ") and "--from" not in line]
    sources = {source for group in copied for source in group}
    assert {"flows", "tasks", "adjust", "requirements.lock"} <= sources
    assert not [source for source in sorted(sources) if not (REPOSITORY / source).exists()]
    let_through = (REPOSITORY / ".dockerignore").read_text().split()
    assert {f"!{source}" for source in sources} <= set(let_through)


def test_no_secret_has_a_value() -> None:
    lines = (DEPLOY / "aerocal.env.example").read_text().splitlines()
    given = dict(line.split("=", 1) for line in lines if line and line[0] != "#")
    secret = ("PREFECT_SERVER_API_AUTH_STRING", "PREFECT_API_AUTH_STRING", "PGPASSWORD", "AEROCAL_NOTIFY")
    assert {name: given[name] for name in secret} == dict.fromkeys(secret, "")


def test_server_and_runner_of_compose_share_projects_records_and_settings() -> None:
    server, runner = (compose()["services"][name] for name in ("server", "runner"))
    projects = [[one for one in service["volumes"] if one.endswith((":/data/projects", ":/data/inbox"))]
                for service in (server, runner)]  # fmt: skip
    assert projects[0] == projects[1]
    assert len(projects[0]) == 2
    of_records = {one for one in server["command"] if one.startswith("--database=")}
    assert of_records < set(runner["command"])
    assert server["env_file"] == runner["env_file"]
    assert server["stop_grace_period"] == runner["stop_grace_period"]
    declared = {one.split(":")[0] for service in compose()["services"].values() for one in service["volumes"]}
    assert declared == set(compose()["volumes"])


def test_the_secret_of_compose_comes_from_the_file_that_its_command_names() -> None:
    """Compose takes it from the variables of its own command, never from the env_file of a service."""
    command = "docker compose --env-file deploy/aerocal.env -f deploy/compose.yaml up -d"
    assert command in (DEPLOY / "compose.yaml").read_text()
    assert command in (REPOSITORY / "docs" / "operations.md").read_text()
    ((_, secret),) = compose()["secrets"].items()
    assert f"\n{secret['environment']}=" in (DEPLOY / "aerocal.env.example").read_text()


def test_what_is_filled_in_takes_effect_everywhere() -> None:
    """A variable of a service replaces the one of the same name in the file of settings."""
    lines = (DEPLOY / "aerocal.env.example").read_text().splitlines()
    filled_in = {line.split("=", 1)[0] for line in lines if line and line[0] != "#"}
    (container,) = kubernetes("Deployment")["spec"]["template"]["spec"]["containers"]
    assert not filled_in & {one["name"] for one in container.get("env", ())}
    for service in (compose()["services"][name] for name in ("server", "runner")):
        for name in filled_in & service.get("environment", {}).keys():
            assert f"${{{name}-}}" in service["environment"][name]


def test_every_folder_of_the_server_in_kubernetes_is_there_at_its_first_start() -> None:
    pod = kubernetes("Deployment")["spec"]["template"]["spec"]
    (container,) = pod["containers"]
    there = {mount["mountPath"] for mount in container["volumeMounts"]}
    for first in pod.get("initContainers", ()):
        assert first["volumeMounts"] == [
            one for one in container["volumeMounts"] if one in first["volumeMounts"]
        ]
        assert first["command"][:2] == ["mkdir", "-p"]
        there |= set(first["command"][2:])
    named = [one.split("=")[1] for one in container["args"] if one.startswith(("--root=", "--inbox="))]
    assert len(named) == 2
    assert set(named) <= there


@pytest.mark.prefect
def test_every_story_has_a_deployment_that_is_started_by_hand() -> None:
    from flows.serving.deployed import STORIES

    manual = {
        one["entrypoint"].rpartition(".")[2] for one in prefect_deployments() if one["name"] == "manual"
    }
    assert manual == {story.fn.__name__ for story in STORIES}


@pytest.mark.prefect
def test_every_deployment_names_a_flow_of_ours() -> None:
    from prefect import Flow

    for one in prefect_deployments():
        module, _, name = one["entrypoint"].rpartition(".")
        assert isinstance(getattr(import_module(module), name), Flow)
        assert one["tags"] == ["aerocal"]


def test_an_end_is_waited_for_longer_than_the_longest_run() -> None:
    from flows.serving.deployed import aerial_triangulation

    longest = float(aerial_triangulation.timeout_seconds or 0)
    assert longest >= 3600
    grace = kubernetes("Deployment")["spec"]["template"]["spec"]["terminationGracePeriodSeconds"]
    unit = (DEPLOY / "systemd" / "aerocal.service").read_text()
    hours = re.search(r"TimeoutStopSec=(\d+)h", unit)
    composed = re.fullmatch(r"(\d+)h", compose()["services"]["server"]["stop_grace_period"])
    assert hours is not None
    assert composed is not None
    assert min(grace, int(hours[1]) * 3600, int(composed[1]) * 3600) > longest
