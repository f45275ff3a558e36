"""The record of a calibration names every file it was made from, also files of one name."""

from __future__ import annotations

import hashlib
from pathlib import Path

from tasks.stages.calibration import digests_of_files


def test_files_of_the_same_name_in_several_folders_are_all_there(tmp_path: Path) -> None:
    contents = {
        "control/points.txt": b"1 10.0 20.0 5.0",
        "flight-1/points.txt": b"a 1 0.1 0.2",
        "flight-1/raw/events.txt": b"100.0",
        "flight-2/raw/events.txt": b"200.0",
        "camera.txt": b"c 100.0",
    }
    for name, content in contents.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(content)
    paths = [tmp_path / name for name in contents]
    # One file may be given twice, as for two flights.
    found = digests_of_files([*paths, paths[0]])
    assert found == {name: hashlib.sha256(content).hexdigest() for name, content in contents.items()}
    assert list(digests_of_files(paths[2:3])) == ["events.txt"]
