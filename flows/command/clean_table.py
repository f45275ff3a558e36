"""Carry out ``aerocal clean`` and show what was removed and what was kept."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table
from rich.text import Text

from flows.command.exit_code import DONE, remark
from flows.command.screen_table import screen, screen_table
from flows.runs.clean_up import Act, CleanedFolders, clean_up_below, megabytes
from tasks.files.json_text import JSON, json_text
from tasks.results.retention import CleanUp


def execute_clean_up(folders: Sequence[Path], older_than: int, act: Act, *, as_json: bool) -> int:
    """Clean up, and print folder by folder what was done."""
    done = clean_up_below(folders, older_than, act)
    if as_json:
        print(json_text(_as_json(done), indent=2))
        return DONE
    console = screen()
    if any(one.removed or one.leftovers for one in done.folders):
        console.print(_table(done))
    total, *others = (sentence for sentence in done.sentences)
    console.print(Text(total, "bold"), soft_wrap=True)
    refused = len(done.refused)
    for sentence in others[: len(others) - refused]:
        console.print(Text(sentence), soft_wrap=True)
    for sentence in others[len(others) - refused :]:
        remark(sentence)
    return DONE


def _table(done: CleanedFolders) -> Table:
    """One row for each folder from which something is removed."""
    numbers = ("outputs", "leftovers", "freed", "kept")
    table = screen_table("output folder", *numbers, right=numbers)
    for one in done.folders:
        if one.removed or one.leftovers:
            counts = (len(one.removed), len(one.leftovers), megabytes(one.freed), len(one.kept))
            table.add_row(Text(str(one.directory)), *map(str, counts))
    return table


def _as_json(done: CleanedFolders) -> JSON:
    return {
        "removed": done.act == "remove",
        "freed_bytes": done.freed,
        "folders": [_folder_json(one) for one in done.folders],
    }


def _folder_json(one: CleanUp) -> JSON:
    return {
        "directory": str(one.directory),
        "outputs": [
            {
                "stage": output.stage,
                "key": output.key,
                "last_used": output.last_used.isoformat(timespec="seconds"),
                "bytes": output.size,
            }
            for output in one.removed
        ],
        "leftovers": [str(leftover) for leftover in one.leftovers],
        "freed_bytes": one.freed,
        "kept": [{"stage": output.stage, "key": output.key, "because": why} for output, why in one.kept],
        "refusal": one.refusal,
    }
