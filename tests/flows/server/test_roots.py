"""Deployed runs stay under the configured folders."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from flows.runs.project_run import RunRequest
from flows.server.roots import ROOTS_VARIABLE, Roots, as_variable, configured_roots, roots_of
from tasks.errors import InputError


@pytest.fixture
def roots(tmp_path: Path, write_project: Callable[..., Path]) -> Roots:
    write_project(tmp_path / "root" / "block")
    write_project(tmp_path / "outside")
    return roots_of([tmp_path / "root"])


def test_a_project_is_found_by_file_by_folder_and_absolutely(roots: Roots, tmp_path: Path) -> None:
    file = tmp_path / "root" / "block" / "project.toml"
    for text in ("block", "block/", "block/project.toml", str(file), str(file.parent), "./block/../block"):
        assert roots.project_file(text) == file


@pytest.mark.parametrize(
    "text",
    [
        "../outside/project.toml",
        "block/../../outside/project.toml",
        "{outside}/project.toml",
        "/etc/passwd",
        "/no/such/file",
        "link/project.toml",
        "block/link.toml",
        "folder-of-link",
        "missing",
        "circle",
        "~root/project.toml",
        "",
        " ",
        "block\0",
        "x" * 5000,
    ],
)
def test_what_leads_outside_or_nowhere_is_refused_alike(roots: Roots, tmp_path: Path, text: str) -> None:
    root, outside = tmp_path / "root", tmp_path / "outside"
    (root / "link").symlink_to(outside)
    (root / "block" / "link.toml").symlink_to(outside / "project.toml")
    (root / "folder-of-link").mkdir()
    (root / "folder-of-link" / "project.toml").symlink_to(outside / "project.toml")
    (root / "circle").symlink_to(root / "circle")
    with pytest.raises(InputError) as refused:
        roots.project_file(text.format(outside=outside) if "{outside}" in text else text)
    assert str(root) in refused.value.remedy


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "/tmp", "../x", "out-link", "linked-store", "a\0"])
def test_an_output_folder_is_a_plain_name_that_stays_inside(roots: Roots, tmp_path: Path, name: str) -> None:
    block = tmp_path / "root" / "block"
    (block / "out-link").symlink_to(tmp_path / "outside")
    (block / "linked-store").mkdir()
    (block / "linked-store" / ".store").symlink_to(tmp_path / "outside")
    with pytest.raises(InputError):
        roots.output_folder(block / "project.toml", name)
    assert roots.output_folder(block / "project.toml", "strict") == block / "strict"


def test_inputs_of_a_project_stay_inside_too(
    roots: Roots, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "root" / "block" / "project.toml"
    assert RunRequest(file, roots=roots.folders).project().project.name == "small"
    sound = file.read_text()
    monkeypatch.setenv("SECRET", "password-of-the-server")
    for path in ("../../outside/exposures.csv", "../../no-such-file.csv", "${SECRET}/exposures.csv"):
        file.write_text(sound.replace('"exposures.csv"', f'"{path}"'))
        with pytest.raises(InputError) as refused:
            RunRequest(file, roots=roots.folders).project()
        assert "password-of-the-server" not in str(refused.value)
        if path.startswith(".."):
            assert "is not in a folder" in str(refused.value)
    file.write_text(sound)
    (file.parent / "exposures.csv").unlink()
    (file.parent / "exposures.csv").symlink_to(tmp_path / "outside" / "exposures.csv")
    with pytest.raises(InputError, match="is not in a folder"):
        RunRequest(file, roots=roots.folders).project()
    assert RunRequest(file).project().project.name == "small"


def test_roots_travel_in_the_environment_and_without_them_nothing_may_be_read(roots: Roots) -> None:
    assert configured_roots({ROOTS_VARIABLE: as_variable(roots)}) == roots
    for environment in ({}, {ROOTS_VARIABLE: ""}, {ROOTS_VARIABLE: "{}"}, {ROOTS_VARIABLE: '["/no/such"]'}):
        with pytest.raises(InputError):
            configured_roots(environment)
