"""Carry out ``aerocal convert-distortion`` and show values and misfit."""

from __future__ import annotations

from pathlib import Path

from rich.text import Text

from flows.command.exit_code import DONE, remark
from flows.command.screen_table import screen, screen_table
from tasks.block.converted_distortion import ConvertedDistortion, convert_distortion
from tasks.files.json_text import json_text
from tasks.georeferencing.registered_cameras import with_registered_cameras
from tasks.settings.load import load_project


def show_conversion(
    project_file: Path,
    overrides: tuple[str, ...],
    data: Path | None,
    camera: str | None,
    selection: str,
    *,
    as_json: bool,
) -> int:
    """Print the converted values as they are written into a project file, and the misfit."""
    project = with_registered_cameras(load_project(project_file, overrides, data))
    found = convert_distortion(project.cameras, camera, selection)
    if as_json:
        print(json_text(found.to_json(), indent=2))
    else:
        _show(found)
    if found.warning is not None:
        remark(found.warning)
    return DONE


def _show(found: ConvertedDistortion) -> None:
    console = screen()
    table = screen_table("parameter", "value", "unit", right=("value",))
    for name, value in found.values.items():
        table.add_row(name, f"{value:.9e}", "" if found.units[name] == "1" else found.units[name])
    console.print(table)
    console.print(
        Text(
            f"Misfit over the format of camera {found.camera} with c = {found.focal_length_mm:.5f} mm: RMS "
            f"{found.rms_um:.3f} µm, largest {found.largest_um:.3f} µm."
        ),
        soft_wrap=True,
    )
    # What a project file takes, in one line: not wrapped, so that it can be copied.
    values = ", ".join(f'"{name}" = {value!r}' for name, value in found.values.items())
    console.print(Text(f"additional_parameters = {{ {values} }}"), soft_wrap=True)
