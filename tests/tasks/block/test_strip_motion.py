"""Times and velocities of exposures along their strips."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tasks.block.strip_motion import strip_motion


def test_an_exposure_without_time_takes_none_from_its_strip() -> None:
    along = np.arange(5.0)
    given = SimpleNamespace(
        image=tuple("abcde"),
        observed=np.column_stack([60.0 * along, np.zeros(5), np.zeros(5)]),
        velocity=np.full((5, 3), np.nan),
        strips=("1",),
        strip_of_image=np.zeros(5, dtype=np.int64),
        time_s=np.array([0.0, 1.0, np.nan, 3.0, 4.0]),
    )
    found = strip_motion(given)  # type: ignore[arg-type]
    assert found.since_middle == pytest.approx([-2.0, -1.0, 0.0, 1.0, 2.0])
    assert found.velocity[:, 0] == pytest.approx([60.0, 60.0, 0.0, 60.0, 60.0])
