from __future__ import annotations

from pathlib import Path

import pytest

from tasks.calibration.observable import is_georeferenced, observable
from tasks.errors import InputError
from tasks.settings.load import load_project


def test_what_nothing_observes_is_not_calibrated(write_project, tmp_path: Path) -> None:
    file = write_project(tmp_path)
    project = load_project(file, ())
    same, remarks = observable(project)
    assert (same.calibration.free, remarks) == (project.calibration.free, ())
    assert is_georeferenced(project)

    alone = load_project(file, ('adjustment.observe=["control"]',))
    left, remarks = observable(alone)
    assert left.calibration.free == ("focal_length", "principal_point")
    assert not is_georeferenced(alone)
    assert "gnss_shift and gnss_strip_bias" in remarks[0]
    assert "boresight" in remarks[1]

    with_ins, remarks = observable(load_project(file, ('adjustment.observe=["ins", "control"]',)))
    assert with_ins.calibration.free == ("boresight", "focal_length", "principal_point")
    assert len(remarks) == 1


def test_a_calibration_of_nothing_is_refused(write_project, tmp_path: Path) -> None:
    change = ('adjustment.observe=["control"]', 'calibration.free=["boresight", "gnss_shift"]')
    with pytest.raises(InputError, match=r"No observation determines what calibration\.free lists"):
        observable(load_project(write_project(tmp_path), change))
