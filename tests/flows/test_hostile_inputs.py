"""A damaged or hostile input ends in one sentence, or in a result that is as good or is not silent."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, Phase, given, settings

from tasks.registry.calibration_file import SealedRecord
from tests.command_line import aerocal
from tests.flows.hostile_inputs import CALIBRATION, FILES, HOSTILE, Hostile, hostile_block
from tests.tasks.registry.records import record

#: One sentence, at most a screen.
_SCREEN = 24 * 80
_X0 = ("x_m", "y_m", "z_m", "omega_deg", "phi_deg", "kappa_deg")
#: As they come, without looking for simpler ones: each is a run.
_AS_THEY_COME = {"phases": (Phase.explicit, Phase.generate), "suppress_health_check": list(HealthCheck)}


@dataclass(frozen=True)
class Block:
    """The sound block: its folder, what a run of it has given, and a folder to try changes in."""

    folder: Path
    orientations: pd.DataFrame
    problems: frozenset[str]
    tried: Path


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Block:
    folder = tmp_path_factory.mktemp("sound")
    project = hostile_block(folder)
    (folder / CALIBRATION).write_text(SealedRecord.of(record()).content, encoding="utf-8")
    done = aerocal("adjust", project, "--out", folder / "results")
    assert done.returncode == 0, done.stderr
    return Block(folder, _orientations(folder), _problems(folder), tmp_path_factory.mktemp("tried"))


def _orientations(folder: Path) -> pd.DataFrame:
    return pd.read_parquet(folder / "results" / "exterior_orientations.parquet").set_index("image")


def _problems(folder: Path) -> frozenset[str]:
    """What the summary says, whatever numbers stand in it."""
    sentences = json.loads((folder / "results" / "summary.json").read_text())["problems"]
    return frozenset(re.sub(r"[\d.,−-]+", "#", sentence) for sentence in sentences)


def try_it(block: Block, change: Hostile, command: str) -> None:
    """Carry out a command on the changed block; everything that may not be is a failed assertion."""
    shutil.rmtree(block.tried, ignore_errors=True)
    block.tried.mkdir()
    for file in (*FILES, CALIBRATION):
        shutil.copy(block.folder / file, block.tried)
    options = change.made_to(block.tried)
    if change.file == CALIBRATION:
        registry = block.tried / "registry.sqlite"
        done = aerocal("registry", "add", block.tried / CALIBRATION, "--registry", registry)
    else:
        # Stages that the change does not touch are reused.
        out = block.tried / "results" if command == "adjust" else block.folder / "results"
        shutil.copytree(block.folder / "results", block.tried / "results")
        done = aerocal(command, block.tried / "project.toml", "--out", out, *options)
    assert done.returncode in (0, 2, 3, 4), (change, done.stderr)
    assert "Traceback" not in done.stderr, change
    if done.returncode in (2, 3):
        said = done.stderr[done.stderr.rindex("Error: ") :] if "Error: " in done.stderr else done.stderr
        assert len(said) <= _SCREEN, (change, said)
    elif done.returncode == 0 and command == "adjust" and change.file != CALIBRATION:
        assert not _is_silently_wrong(block), (change, done.stderr)


def _is_silently_wrong(block: Block) -> bool:
    """Whether an orientation has moved by more than 3 σ and the run has nothing new to say."""
    found, sound = _orientations(block.tried), block.orientations
    both = sound.index.intersection(found.index)
    names = [f"sigma_{name}" for name in _X0]
    moved = np.abs(found.loc[both, list(_X0)].to_numpy() - sound.loc[both, list(_X0)].to_numpy())
    moved[:, 3:] = np.abs((moved[:, 3:] + 180.0) % 360.0 - 180.0)
    sigma = np.fmax(found.loc[both, names].to_numpy(), sound.loc[both, names].to_numpy())
    return bool((moved > 3.0 * sigma).any()) and _problems(block.tried) <= block.problems


@settings(max_examples=60, **_AS_THEY_COME)
@given(change=HOSTILE)
def test_a_changed_input_is_refused_in_one_sentence(block: Block, change: Hostile) -> None:
    try_it(block, change, "doctor")


@settings(max_examples=8, **_AS_THEY_COME)
@given(change=HOSTILE)
def test_a_changed_input_gives_no_other_result_in_silence(block: Block, change: Hostile) -> None:
    try_it(block, change, "adjust")


@pytest.mark.slow
@pytest.mark.timeout(7_200)
@settings(max_examples=1_000, **_AS_THEY_COME)
@given(change=HOSTILE)
def test_a_thousand_changed_inputs(block: Block, change: Hostile) -> None:
    try_it(block, change, "adjust")
