"""Numbers as they are shown, and their full values."""

from __future__ import annotations

import pytest

from tasks.document_kit.table import Number, decimals_for


@pytest.mark.parametrize(
    ("value", "decimals", "plus", "shown"),
    [
        (1234567.0, 0, False, "1,234,567"),
        (0.0256, 3, True, "+0.026"),
        (-0.0256, 3, True, "−0.026"),
        (0.00003, 3, True, "0.000"),
        (-0.00003, 3, False, "0.000"),
        (1.01449e-9, 12, False, "1.014e−9"),
        (-1.01449e-9, 12, True, "−1.014e−9"),
        (1.01449e-9, 10, True, "+1.0e−9"),
        (4e-12, 10, False, "4e−12"),
        (0.5, 9, False, "5.00000000e−1"),
        (0.0, 12, False, "0"),
        (None, 3, False, "–"),
        (float("nan"), 3, False, "–"),
        (float("inf"), 0, False, "–"),
    ],
)
def test_a_number_shows_its_digits(value: float | None, decimals: int, plus: bool, shown: str) -> None:
    assert str(Number(value, decimals, plus)) == shown


def test_the_full_value_reads_back_exactly() -> None:
    assert float(Number(0.1 + 0.2, 1).data) == 0.1 + 0.2
    assert Number(None).data == ""


@pytest.mark.parametrize(
    ("sigma", "decimals"),
    [(0.00081, 5), (0.0996, 2), (0.13, 2), (12.0, 0), (0.0, 0), (None, 0), (1.5e-10, 11), (9.96e-10, 10)],
)
def test_a_standard_deviation_gets_two_digits(sigma: float | None, decimals: int) -> None:
    assert decimals_for(sigma) == decimals
