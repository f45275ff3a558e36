"""Published files that somebody edited: a run that would replace one ends before anything is computed."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection
from pathlib import Path


def require_refused_at_start(
    out: Path, file: str, certain: Collection[str], run_again: Callable[[], object]
) -> None:
    """Edit a file of finished results; the next run of the same kind names it and does nothing else.

    Parameters
    ----------
    out : the results.
    file : name of the file to edit there.
    certain : names that such a run always publishes.
    """
    assert set(certain) <= set(json.loads((out / "manifest.json").read_text())["artifacts"])
    path = out / file
    edited = path.read_bytes() + b"checked by Ann"
    path.unlink()
    path.write_bytes(edited)
    run_again()
    summary = json.loads((out / "summary.json").read_text())
    assert summary["status"] == "input_error"
    assert f"{file}: The file would be replaced" in summary["problems"][0]
    assert set(summary["timings_s"]) == {"total"}
    assert path.read_bytes() == edited
