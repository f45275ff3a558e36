"""Coverage factors against the table of the GUM."""

from __future__ import annotations

import pytest

from tasks.documents.certificate.coverage import coverage_factor


@pytest.mark.parametrize(
    ("freedom", "k"), [(1, 12.71), (4, 2.78), (10, 2.23), (50, 2.01), (100, 1.984), (None, 1.960)]
)
def test_the_factor_is_that_of_table_g2(freedom: int | None, k: float) -> None:
    """JCGM 100:2008, table G.2, fraction 95 %."""
    found = coverage_factor(freedom)
    assert found.k == pytest.approx(k, abs=0.5 * 10.0 ** -len(str(k).partition(".")[2]))
    assert ("normal" in found.words) == (freedom is None)
