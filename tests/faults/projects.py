"""Simulated projects of mixed sizes for an inbox, some of them faulty, each in another way."""

from __future__ import annotations

import hashlib
import json
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project

#: Presets in the order in which projects take them: 60, 52 and 200 images.
PRESETS = ("dmc-20cm", "ucx-20cm", "dmc-20cm", "ucx-20cm", "uce-low")


def _without_column(folder: Path) -> None:
    _edit(folder / "exposures.csv", lambda text: text.replace("heading", "course", 1))


def _wrong_unit(folder: Path) -> None:
    _edit(folder / "project.toml", lambda text: text.replace('unit = "mm"', 'unit = "px"', 1))


def _truncated(folder: Path) -> None:
    _edit(folder / "image_points.csv", lambda text: text[: len(text) // 2 - 3])


def _missing(folder: Path) -> None:
    (folder / "control.csv").unlink()


def _duplicates(folder: Path) -> None:
    def doubled(text: str) -> str:
        lines = text.splitlines()
        return "\n".join([*lines, lines[1]]) + "\n"

    _edit(folder / "exposures.csv", doubled)


def _strict_gate(folder: Path) -> None:
    _edit(folder / "project.toml", lambda text: text + "\n[gates]\nsigma0 = { max = 0.01 }\n")


def _without_datum(folder: Path) -> None:
    """A free shift of the GNSS positions and no control point: nothing says where the block lies."""
    _edit(folder / "control.csv", lambda text: text.replace(",control", ",check"))
    _edit(folder / "project.toml", lambda text: text.replace("free = []", 'free = ["gnss_shift"]'))


FAULTS: dict[str, Callable[[Path], None]] = {
    "missing column": _without_column,
    "wrong unit": _wrong_unit,
    "truncated file": _truncated,
    "missing file": _missing,
    "duplicate ids": _duplicates,
    "gate that fails": _strict_gate,
    "datum defect": _without_datum,
}


@dataclass(frozen=True)
class Simulated:
    """A project, and how it must end.

    Attributes
    ----------
    name : of its folder.
    fault : what is wrong with it; None: nothing.
    state : in which a run by hand has ended.
    digests : of the files that this run has published, by name.
    seconds : that this run took, in a process that had done others before.
    """

    name: str
    fault: str | None
    state: str
    digests: dict[str, str]
    seconds: float


def simulated(folder: Path, number: int, first_seed: int = 1, *, faulty: bool = True) -> list[Simulated]:
    """Write so many projects, adjust each by hand; every seventh is `faulty` (of fewer the last), in turn."""
    kinds = list(FAULTS)
    every = min(7, number)
    made = []
    for index in range(number):
        place = folder / f"block-{first_seed + index:03d}"
        preset = PRESETS[index % len(PRESETS)]
        simulate_project(load_simulation(preset, (), first_seed + index), place)
        shutil.rmtree(place / "truth", ignore_errors=True)
        is_faulty = faulty and index % every == every - 1
        fault = kinds[(index // every + first_seed) % len(kinds)] if is_faulty else None
        if fault is not None:
            FAULTS[fault](place)
        made.append(_expected(place, folder / "by-hand" / place.name, fault))
    return made


def _expected(place: Path, out: Path, fault: str | None) -> Simulated:
    started = time.perf_counter()
    outcome = carry_out(aerial_triangulation, RunRequest(place / "project.toml", out))
    seconds = time.perf_counter() - started
    found = Simulated(place.name, fault, outcome.state, published(out), seconds)
    shutil.rmtree(out, ignore_errors=True)
    return found


def published(out: Path) -> dict[str, str]:
    """Digests that the manifest of an output folder names; empty without a manifest."""
    try:
        artifacts = json.loads((out / "manifest.json").read_text())["artifacts"]
    except FileNotFoundError:
        return {}
    return {entry["file"]: entry["sha256"] for entry in artifacts.values()}


def deliver(source: Path, inbox: Path) -> None:
    """Copy a project file by file, as a slow line would, and its marker last."""
    target = inbox / source.name
    target.mkdir()
    for file in sorted(source.iterdir()):
        shutil.copy(file, target / file.name)
        time.sleep(0.05)
    (target / "DELIVERED").touch()


def damage(out: Path) -> list[str]:
    """The files of an output folder whose bytes are not those that manifest and stage records promise."""
    wrong = []
    for file, digest in published(out).items():
        if _digest(out / file) != digest and published(out).get(file) == digest:
            wrong.append(str(out / file))
    for record in out.glob(".store/*/[0-9a-f]*/stage.json"):
        try:
            for entry in json.loads(record.read_text())["files"]:
                if _digest(record.parent / entry["file"]) != entry["sha256"]:
                    wrong.append(str(record.parent / entry["file"]))
        except FileNotFoundError:
            # Cleared away between the two looks.
            continue
    return wrong


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else "gone"


def _edit(file: Path, change: Callable[[str], str]) -> None:
    file.write_text(change(file.read_text()))
