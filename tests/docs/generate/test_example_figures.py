"""The pages state the figures of the example that are kept beside it."""

from __future__ import annotations

import json

import pytest

from docs.generate.example_figures import FIGURES, ROOT, SENTENCES, with_figures


@pytest.mark.parametrize(("page", "sentence"), SENTENCES, ids=[page for page, _ in SENTENCES])
def test_a_page_states_the_figures_of_the_run(page: str, sentence: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    figures = json.loads(FIGURES.read_text(encoding="utf-8"))
    assert with_figures(text, sentence, figures) == text, "run python -m docs.generate.example_figures"


def test_a_wrong_figure_is_mended_and_a_sentence_that_is_gone_is_named() -> None:
    sentence = "{rejected:,} of {all} are rejected"
    text = "Here 12 of\n7 are rejected."
    assert with_figures(text, sentence, {"rejected": 1234, "all": 7}) == "Here 1,234 of\n7 are rejected."
    with pytest.raises(ValueError, match="0 times"):
        with_figures("Nothing.", sentence, {"rejected": 1, "all": 2})
