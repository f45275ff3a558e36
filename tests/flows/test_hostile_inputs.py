"""A damaged or hostile input ends in one sentence, or in a result that is as good or is not silent."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, Phase, example, given, settings

from tasks.registry.calibration_file import SealedRecord
from tasks.settings.registry import REGISTRY_VARIABLE
from tests.command_line import aerocal
from tests.flows.hostile_calibrations import (
    FOLDER,
    HOSTILE_CALIBRATION,
    TABLE_CHANGES,
    TABLES,
    change_table,
    write_registered,
)
from tests.flows.hostile_inputs import (
    CALIBRATION,
    FILES,
    HOSTILE,
    REGISTERED,
    REGISTRY,
    Hostile,
    hostile_block,
)
from tests.tasks.registry.records import record

#: One sentence, at most a screen.
_SCREEN = 24 * 80
_X0 = ("x_m", "y_m", "z_m", "omega_deg", "phi_deg", "kappa_deg")
_DIFFERENCES = ("dx_m", "dy_m", "dz_m")
#: As they come, without looking for simpler ones: each is a run.
_AS_THEY_COME = {"phases": (Phase.explicit, Phase.generate), "suppress_health_check": list(HealthCheck)}


@dataclass(frozen=True)
class Sound:
    """What a run of a sound project has given: coordinates with σ by entity, and what it had to say."""

    values: pd.DataFrame
    problems: frozenset[str]


@dataclass(frozen=True)
class Block:
    """The sound block, what runs of it have given, and a folder to try changes in."""

    folder: Path
    tried: Path
    adjusted: Sound
    registered: Sound
    checked: Sound


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Block:
    folder = tmp_path_factory.mktemp("sound")
    project = hostile_block(folder)
    (folder / CALIBRATION).write_text(SealedRecord.of(record()).content, encoding="utf-8")
    write_registered(folder)
    found = {}
    for command, file, out, *options in (
        ("adjust", project, "results"),
        ("adjust", folder / REGISTERED, "registered"),
        ("check", project, "checked", "--set", f"direct_georeferencing.calibration={folder / FOLDER}"),
    ):
        done = aerocal(command, file, "--out", folder / out, *options, **_registry(folder))
        assert done.returncode == 0, done.stderr
        if out == "results":
            (folder / FOLDER).mkdir()
            for name in TABLES:
                shutil.copy(folder / out / f"{name}.parquet", folder / FOLDER)
        found[out] = _sound(folder / out)
    tried = tmp_path_factory.mktemp("tried")
    return Block(folder, tried, found["results"], found["registered"], found["checked"])


def _registry(folder: Path) -> dict[str, str]:
    return {REGISTRY_VARIABLE: str(folder / REGISTRY)}


def _sound(results: Path) -> Sound:
    """Orientations or, of a check, differences at surveyed points."""
    table, key, names = results / "exterior_orientations.parquet", "image", _X0
    if not table.exists():
        table, key, names = results / "direct_georeferencing.parquet", "point", _DIFFERENCES
    sigmas = [f"sigma_{name}" for name in names]
    values = pd.read_parquet(table).set_index(key)[[*names, *sigmas]]
    # What the summary says, whatever numbers stand in it.
    sentences = json.loads((results / "summary.json").read_text())["problems"]
    return Sound(values, frozenset(re.sub(r"[\d.,−-]+", "#", sentence) for sentence in sentences))


def try_it(block: Block, change: Hostile, command: str) -> None:
    """Carry out a command on the changed block; everything that may not be is a failed assertion."""
    shutil.rmtree(block.tried, ignore_errors=True)
    block.tried.mkdir()
    for file in (*FILES, CALIBRATION, REGISTERED, REGISTRY):
        shutil.copy(block.folder / file, block.tried)
    shutil.copytree(block.folder / FOLDER, block.tried / FOLDER)
    if change.what in TABLE_CHANGES:
        change_table(block.tried / change.file, change)
        options: tuple[str, ...] = ()
    else:
        options = change.made_to(block.tried)
    if change.file == CALIBRATION:
        registry = block.tried / "new.sqlite"
        done = aerocal("registry", "add", block.tried / CALIBRATION, "--registry", registry)
        _require_one_sentence(done, change)
        return
    file, sound, before = "project.toml", block.adjusted, "results"
    if change.file.startswith(FOLDER):
        command, sound, before = "check", block.checked, "checked"
        options = ("--set", f"direct_georeferencing.calibration={block.tried / FOLDER}")
    elif change.file in (REGISTERED, REGISTRY):
        file, sound, before = REGISTERED, block.registered, "registered"
    # Stages that the change does not touch are reused.
    out = block.folder / before if command == "doctor" else block.tried / "results"
    shutil.copytree(block.folder / before, block.tried / "results")
    done = aerocal(command, block.tried / file, "--out", out, *options, **_registry(block.tried))
    _require_one_sentence(done, change)
    if done.returncode == 0 and command != "doctor":
        assert not _is_silently_wrong(sound, _sound(block.tried / "results")), (change, done.stderr)


def _require_one_sentence(done: subprocess.CompletedProcess[str], change: Hostile) -> None:
    """A result or one sentence; a registry that was damaged is the installation's fault."""
    assert done.returncode in (0, 2, 3, 4, *((1,) if change.file == REGISTRY else ())), (change, done.stderr)
    assert "Traceback" not in done.stderr, change
    if done.returncode in (1, 2, 3):
        said = done.stderr[done.stderr.rindex("Error: ") :] if "Error: " in done.stderr else done.stderr
        assert said.strip(), change
        assert len(said) <= _SCREEN, (change, said)


def _is_silently_wrong(sound: Sound, found: Sound) -> bool:
    """Whether an orientation or difference has moved by more than 3 σ and the run has nothing new to say."""
    both = sound.values.index.intersection(found.values.index)
    one, other = (item.values.loc[both].to_numpy() for item in (sound, found))
    count = one.shape[1] // 2
    moved = np.abs(other[:, :count] - one[:, :count])
    # Angles behind the coordinates, degrees.
    moved[:, 3:] = np.abs((moved[:, 3:] + 180.0) % 360.0 - 180.0)
    sigma = np.fmax(other[:, count:], one[:, count:])
    return bool((moved > 3.0 * sigma).any()) and found.problems <= sound.problems


# Few of them, as each is a run; the slow tests have hundreds.
@settings(max_examples=6, **_AS_THEY_COME)
@given(change=HOSTILE)
def test_a_changed_input_is_refused_in_one_sentence(block: Block, change: Hostile) -> None:
    try_it(block, change, "doctor")


@settings(max_examples=4, **_AS_THEY_COME)
@example(change=Hostile("factor", "control.csv", 0.94, 0.33, "1.001"))  # One of four control points, 0.14 m.
@given(change=HOSTILE)
def test_a_changed_input_gives_no_other_result_in_silence(block: Block, change: Hostile) -> None:
    try_it(block, change, "adjust")


@settings(max_examples=6, **_AS_THEY_COME)
@given(change=HOSTILE_CALIBRATION)
def test_a_changed_calibration_is_refused_or_gives_no_other_result_in_silence(
    block: Block, change: Hostile
) -> None:
    try_it(block, change, "adjust")


@pytest.mark.slow
@pytest.mark.timeout(7_200)
@settings(max_examples=1_000, **_AS_THEY_COME)
@given(change=HOSTILE)
def test_a_thousand_changed_inputs(block: Block, change: Hostile) -> None:
    try_it(block, change, "adjust")


@pytest.mark.slow
@pytest.mark.timeout(7_200)
@settings(max_examples=400, **_AS_THEY_COME)
@given(change=HOSTILE_CALIBRATION)
def test_hundreds_of_changed_calibrations(block: Block, change: Hostile) -> None:
    try_it(block, change, "adjust")
