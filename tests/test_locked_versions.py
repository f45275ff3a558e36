"""What is installed is what the locks say, and the locks hold all that is needed and nothing but versions."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import distributions

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.conftest import REPOSITORY

LOCKS = sorted(path.name for path in REPOSITORY.glob("requirements*.lock"))
#: Installed besides: this package in place, and the peer of the benchmarks.
BESIDES = {"setuptools", "aerocal", "pycolmap"}
CLASSIFIER = "Programming Language :: Python :: 3."


def locked(name: str) -> dict[str, str]:
    """Version by name of a lock; every line but a comment must be NAME==VERSION."""
    lines = (REPOSITORY / name).read_text(encoding="utf-8").splitlines()
    found: dict[str, str] = {}
    for line in lines:
        if line.startswith("#"):
            continue
        # No address, no hash, no option: which index is asked is the business of whoever installs.
        match = re.fullmatch(r"([A-Za-z0-9][A-Za-z0-9._-]*)==([0-9][A-Za-z0-9.!+_-]*)", line)
        assert match is not None, f"{name}: {line!r}"
        package = canonicalize_name(match.group(1))
        assert package not in found, f"{name} has {package} twice"
        found[package] = match.group(2)
    assert found
    return found


@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_names_versions_and_neither_hosts_nor_addresses_nor_hashes(name: str) -> None:
    locked(name)
    assert "://" not in (REPOSITORY / name).read_text(encoding="utf-8")


def test_what_is_installed_is_what_is_locked() -> None:
    installed = {canonicalize_name(one.metadata["Name"]): one.version for one in distributions()}
    wanted = locked("requirements-dev.lock")
    others = {name for name in BESIDES if name not in wanted}
    assert {name: version for name, version in installed.items() if name not in others} == wanted


def test_what_production_installs_is_a_part_of_what_is_tested() -> None:
    tested = locked("requirements-dev.lock")
    assert locked("requirements.lock").items() <= tested.items()
    assert not locked("requirements-bench.lock").keys() & tested.keys()


def test_everything_the_package_declares_is_locked_in_a_version_it_takes() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = [(text, "requirements.lock") for text in project["dependencies"]]
    locks = {"dev": "requirements-dev.lock", "bench": "requirements-bench.lock"}
    for extra, wanted in project["optional-dependencies"].items():
        declared += [(text, locks.get(extra, "requirements.lock")) for text in wanted]
    for text, lock in declared:
        requirement = Requirement(text)
        if requirement.name == "aerocal":  # all extras together
            assert requirement.extras == project["optional-dependencies"].keys() - {"all", "dev", "bench"}
            continue
        version = locked(lock).get(canonicalize_name(requirement.name))
        assert version is not None, f"{lock} lacks {requirement.name}"
        assert requirement.specifier.contains(version), f"{lock}: {text}, {version}"


def test_everything_that_is_needed_by_what_is_locked_is_locked_too() -> None:
    """Whatever the Python: what a lock lacks is found by a user of another one, when it is imported."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    versions = [f"3.{text.removeprefix(CLASSIFIER)}" for text in project["classifiers"] if CLASSIFIER in text]
    assert len(versions) > 1
    pythons = [
        {"extra": "", "python_version": version, "python_full_version": f"{version}.0"}
        for version in versions
    ]
    for lock in ("requirements.lock", "requirements-dev.lock"):
        wanted = locked(lock)
        for one in distributions():
            if canonicalize_name(one.metadata["Name"]) not in wanted:
                continue
            for text in one.requires or ():
                needed = Requirement(text)
                if needed.marker is None or any(needed.marker.evaluate(python) for python in pythons):
                    assert canonicalize_name(needed.name) in wanted, f"{lock}: {one.metadata['Name']}: {text}"
