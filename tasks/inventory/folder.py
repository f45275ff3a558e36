"""Examine a folder of deliveries and draft its project file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tasks.errors import Location
from tasks.files.installation import writing_into
from tasks.inventory.project_text import project_text
from tasks.inventory.recognition import FoundFile, recognised

PROJECT_FILE = "project.toml"
# Folders of results and of programs are not deliveries.
_MOST_FILES = 2_000


@dataclass(frozen=True)
class Inventory:
    """What was found and written.

    Attributes
    ----------
    project_file : the file that was written.
    files : everything in the folder, in the order of the names.
    open_values : number of values that are still to be declared.
    """

    project_file: Path
    files: tuple[FoundFile, ...]
    open_values: int


def begin_project(folder: Path) -> Inventory:
    """Recognise the files of a folder and write its project.toml.

    Raises
    ------
    InputError
        If the folder is none, has a project file already (it is never overwritten), or holds no image points.
    """
    root = folder.resolve()
    if not root.is_dir():
        raise Location(folder).error("This is not a folder.", "Give the folder of the delivered files.")
    target = root / PROJECT_FILE
    if target.exists() or target.is_symlink():
        raise Location(target).error(
            "There is already a project file, and it is never overwritten.",
            "Rename it, or continue with `aerocal doctor`.",
        )
    files = tuple(map(recognised, _files(root)))
    _refuse_nothing(files, root)
    text = project_text(root.name, files, root)
    with writing_into(root), target.open("x", encoding="utf-8") as stream:
        stream.write(text)
    return Inventory(target, files, text.count('"DECLARE: '))


def _files(root: Path) -> list[Path]:
    """Ordinary files below the folder, none of which is hidden."""
    found = [
        path
        for path in sorted(root.rglob("*"))
        if path.is_file()
        and not path.is_symlink()
        and not any(part.startswith(".") for part in path.relative_to(root).parts)
    ]
    if len(found) > _MOST_FILES:
        raise Location(root).error(
            f"The folder contains {len(found):,} files, more than {_MOST_FILES:,}.",
            "Give a folder with the files of one block only, and keep the images elsewhere.",
        )
    return found


def _refuse_nothing(files: Sequence[FoundFile], root: Path) -> None:
    kinds = {content.kind for file in files for content in file.contents}
    if kinds & {"image_points", "exposures", "trajectory"}:
        return
    seen = ", ".join(f"{file.path.name}: {file.remark or 'other'}" for file in files[:8])
    shown = f" ({seen})" if seen else ""
    raise Location(root).error(
        f"None of the {len(files)} files has image points, exposures or a trajectory{shown}.",
        "Put the files of the delivery there; docs/import.md lists the formats that are read.",
    )
