"""Carry out ``aerocal simulate`` and report what was written."""

from __future__ import annotations

from pathlib import Path

from rich.text import Text

from flows.command.exit_code import DONE
from flows.command.screen_table import screen
from tasks.object_storage.address import output_folder
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project


def write_simulation(source: str, out: Path, overrides: tuple[str, ...], seed: int | None) -> int:
    """Write the project of a simulation; a wrong specification raises InputError."""
    files = simulate_project(load_simulation(source, overrides, seed), output_folder(str(out)))
    console = screen()
    counts = (
        f"{files.images:,} images, {files.points:,} object points, {files.image_points:,} image points, "
        f"{files.control} control and {files.check} check points"
    )
    console.print(Text(counts))
    console.print(Text(f"The project is {files.project_file}; its truth is in {out / 'truth'}."))
    console.print(Text(f"Adjust it with: aerocal run {files.project_file}"), soft_wrap=True)
    return DONE
