"""No name of the code on a certificate."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest

from tasks.documents.certificate.documents import document_of
from tasks.documents.certificate.words import in_words
from tests.tasks.documents.certificate.conftest import Calibration, as_json, changed, with_parameter


@pytest.mark.parametrize(
    ("sentence", "words"),
    [
        ("principal_point_x of A is weak", "principal point x of A is weak"),
        ("correlated −68 % with gnss_shift_z of 1.", "correlated −68 % with GNSS shift z of flight 1."),
        ("GNSS shift x of flight 1, 0.5 σ", "GNSS shift x of flight 1, 0.5 σ"),
        ("Check adjustment.priors.", "Check the σ of initial values."),
        ("All in model_alternatives.parquet.", "All in the tables of the results."),
        ("look wrong: +2.12 ± 0.19 ms (t = 10.9)", "look wrong: +2.12 ms (σ 0.19 ms) (t = 10.9)"),
        ("drifts by -0.0182° ± 0.0033° against", "drifts by -0.0182° (σ 0.0033°) against"),
        ("roll −0.02 ± 0.001°.", "roll −0.02° (σ 0.001°)."),
        (
            "P2 +0.000764 ± 3e-05 1/m, K3 -6.82e+03 ± 3.3e+02 1/m⁶",
            "P2 +0.000764 1/m (σ 3e-05 1/m), K3 -6.82e+03 1/m⁶ (σ 3.3e+02 1/m⁶)",
        ),
        (
            "The gate rmse_check_m_x failed: 0.2 ≤ 0.1 m",
            "The limit for RMS at check points, x is not met: 0.2 ≤ 0.1 m",
        ),
        ("Raise checks.control_distance_m.", "Raise control distance."),
        ("correct mount_deg", "correct the mounting"),
        ("Check lever_arm_m: from the camera", "Check lever arm: from the camera"),
        ("Check `heights` and pixel_origin", "Check heights and pixel origin"),
        ("A sentence of words stays.", "A sentence of words stays."),
    ],
)
def test_sentences_get_words(sentence: str, words: str) -> None:
    assert in_words(sentence) == words


def printed(node: Any, key: str = "") -> Iterator[str]:
    """Everything that people read; keys and names are for programs."""
    if isinstance(node, dict):
        for name, child in node.items():
            yield from printed(child, name)
    elif isinstance(node, list):
        for child in node:
            yield from printed(child, key)
    elif isinstance(node, str) and key not in ("kind", "name", "key", "verdict", "code", "tone", "colour"):
        yield node


def test_no_section_prints_a_name_of_the_code(calibration: Calibration) -> None:
    """But the annex of deliveries and settings, which names files and keys as they are written."""
    because = "gnss_shift_z of 1 moves principal_point_x; free time_offset (adjustment.ins_correlation_s)."
    record = with_parameter(
        calibration.record,
        "boresight_roll",
        lambda item: item.model_copy(update={"verdict": "weak", "because": because}),
    )
    record = changed(record, verdict="refused", reasons=(because, because), remarks=(because,))
    sections = as_json(document_of(calibration.content(record)))["sections"]
    texts = [text for section in sections if section["name"] != "origin" for text in printed(section)]
    assert len(texts) > 500
    assert [
        text for text in texts if re.search(r"[a-z]_[a-z]|\.parquet|\b(adjustment|calibration)\.[a-z]", text)
    ] == []
