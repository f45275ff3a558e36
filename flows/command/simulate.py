"""``aerocal simulate``: an ordinary project with known truth."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from flows.command.exit_code import DONE, end_with
from flows.command.options import FOLDER, Seed, SpecificationOverrides


def simulate(
    source: Annotated[
        str, typer.Argument(metavar="PRESET|SPEC.toml", help="Name of a preset, or a specification.")
    ],
    out: Annotated[Path, typer.Option(**FOLDER, help="Folder for the project.")],
    overrides: SpecificationOverrides = None,
    seed: Seed = None,
) -> None:
    """Simulate a block: an ordinary project, with its true values in DIR/truth.

    Orientations, points, parameters, noise and gross errors are known exactly.

    The same seed writes the same bytes.

    [bold]Presets[/bold]

      uce-low, uce-high, uce-calibration: UltraCam Eagle, 5 and 15 cm GSD

      uce-testfield: both heights, control points only, with its scenarios for aerocal sweep

      ucx-8cm, ucx-20cm, dmc-8cm, dmc-20cm, rmk-8cm: Vaihingen

      vaihingen-ucx-high, vaihingen-ucx-low, vaihingen-dmc-high, vaihingen-dmc-low: with scenarios

      dmc-burn-in: 40 images, 14 control points

      dmc2-140, dmc2-230 (2,448 images), dmc2-250: DMC II; ucd, ucxp: the same block with UltraCams

      dmc2-140-test, dmc2-230-test, dmc2-250-test: test blocks with full, double and single coverage

      uce-210: the low flight of the test field with the lens of 210 mm

      vaihingen-rmk-high, vaihingen-rmk-low: film, with fiducial marks

      dmc-heads: 40 exposures of the four heads of a DMC, attitudes as published

      dmc-protocol: the block of a published burn-in protocol of the DMC01-0008

      penta: a nadir head and four heads tilted by 45°, 60 exposures

    [bold]Specifications[/bold]

      A SPEC.toml names a preset and contains the changes:

      seed, project, camera, head, flight, trajectory, terrain, points, control, noise, truth

      DIR/truth/spec.toml shows all values; docs/simulation.md explains them.

    [bold]Examples[/bold]

      aerocal simulate uce-low --out block && aerocal run block/project.toml

      aerocal simulate uce-low --out exact --set noise.level=0

      aerocal simulate my-flight.toml --out trial --seed 7

    [bold]Exit codes[/bold]  0 done · 2 wrong specification
    """
    end_with(lambda: _write_simulation(source, out, tuple(overrides or ()), seed))


def _write_simulation(source: str, out: Path, overrides: tuple[str, ...], seed: int | None) -> int:
    from rich.text import Text

    from flows.command.screen_table import screen
    from tasks.object_storage.address import output_folder
    from tasks.settings.load_simulation import load_simulation
    from tasks.simulation.simulate import simulate_project

    files = simulate_project(load_simulation(source, overrides, seed), output_folder(str(out)))
    console = screen()
    counts = (
        f"{files.images:,} images, {files.points:,} object points, {files.image_points:,} image points, "
        f"{files.control} control and {files.check} check points"
    )
    console.print(Text(counts))
    console.print(Text(f"The project is {files.project_file}; its truth is in {out / 'truth'}."))
    console.print(Text(f"Adjust it with: aerocal run {quote(str(files.project_file))}"), soft_wrap=True)
    return DONE
