"""The pages state the times and the memory that were measured and kept."""

from __future__ import annotations

import pytest

from docs.generate.benchmark_figures import SENTENCES, figures
from docs.generate.example_figures import ROOT, with_figures


@pytest.mark.parametrize(("page", "sentence"), SENTENCES)
def test_a_page_states_what_was_measured(page: str, sentence: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert with_figures(text, sentence, figures()) == text, "run python -m docs.generate.benchmark_figures"


def test_memory_is_stated_in_units_of_1024() -> None:
    measured = figures()
    assert measured["growth_50000_peak_memory_gib"] * 1024 == measured["growth_50000_peak_memory_mib"]
