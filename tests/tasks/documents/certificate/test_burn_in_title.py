"""The title of a burn-in protocol."""

from __future__ import annotations

import pytest

from tasks.documents.certificate.burn_in import title_verdict
from tasks.documents.report.key_figures import Tone


@pytest.mark.parametrize(
    ("triangulation", "calibration", "title"),
    [
        ("good", "accepted", "accepted"),
        ("attention", "accepted", "restricted"),
        ("good", "restricted", "restricted"),
        ("failed", "accepted", "refused"),
        ("good", "refused", "refused"),
    ],
)
def test_the_worse_of_two_verdicts_is_the_title(triangulation: Tone, calibration: str, title: str) -> None:
    assert title_verdict(triangulation, calibration) == title
