"""Read the settings of a simulation: a preset by name, or a SPEC.toml that starts from one.

What a SPEC.toml says replaces what its preset says, key by key. Where the preset has several tables
(``[[flight]]``, ``[[control]]``), a single table changes all of them, and several replace them.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import cast

from tasks.errors import InputError, Location
from tasks.files.delivered_file import is_there
from tasks.nearest_name import did_you_mean
from tasks.settings.base import PathContext
from tasks.settings.settings_file import SettingsFile, SettingsKind, Table, read_settings_file
from tasks.settings.simulation import Simulation

SIMULATION_FILE = SettingsKind(Simulation, "specification", "docs/simulation.md")


def preset_names() -> tuple[str, ...]:
    """Names of the presets, in alphabetical order."""
    return tuple(
        sorted(
            entry.name.removesuffix(".toml") for entry in _folder().iterdir() if entry.name.endswith(".toml")
        )
    )


def preset_text(name: str) -> str:
    """The text of a preset.

    Raises
    ------
    InputError
        If there is none of this name.
    """
    if name not in preset_names():
        raise InputError(f"There is no preset '{name}'.", did_you_mean(name, preset_names()))
    return (_folder() / f"{name}.toml").read_text(encoding="utf-8")


def _folder() -> Traversable:
    return resources.files("tasks.simulation") / "presets"


def load_simulation(source: str, overrides: Sequence[str] = (), seed: int | None = None) -> Simulation:
    """Read and validate a simulation.

    Parameters
    ----------
    source : name of a preset, or path of a SPEC.toml.
    overrides : texts ``a.b.c=VALUE``.
    seed : replaces the seed.

    Raises
    ------
    InputError
        If there is no such preset or file, or a key or value in it is wrong.
    """
    file = _with_preset(Path(source)) if _is_path(source) else _of_preset(source)
    file.replace(overrides)
    if seed is not None:
        file.content["seed"] = seed
    return cast(Simulation, file.validated(PathContext(file.path.resolve().parent)))


def _is_path(source: str) -> bool:
    return source not in preset_names() and (
        source.endswith(".toml") or (is_there(Path(source)) and Path(source).is_file())
    )


def _of_preset(name: str) -> SettingsFile:
    """A preset; one that names another contains only its changes."""
    text = preset_text(name)
    own: Table = tomllib.loads(text)
    other = own.get("preset")
    content = own if other is None else _merged(_of_preset(str(other)).content, own)
    return SettingsFile(SIMULATION_FILE, Path(f"{name}.toml"), text, {**content, "preset": name})


def _with_preset(path: Path) -> SettingsFile:
    """The file with its preset filled in."""
    file = read_settings_file(path, SIMULATION_FILE)
    name = file.content.get("preset")
    if not isinstance(name, str):
        return file
    try:
        preset = _of_preset(name)
    except InputError as error:
        raise Location(path, entity="preset").error(error.what, error.remedy) from error
    return SettingsFile(SIMULATION_FILE, path, file.text, _merged(preset.content, file.content))


def _merged(preset: Table, written: Table) -> Table:
    """The tables of a preset with those of a file put over them."""
    result = dict(preset)
    for key, value in written.items():
        below = preset.get(key)
        if isinstance(value, dict) and isinstance(below, dict):
            result[key] = _merged(below, value)
        elif isinstance(value, dict) and isinstance(below, list):
            result[key] = [_merged(item, value) for item in below]
        else:
            result[key] = value
    return result
