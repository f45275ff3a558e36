"""The pages state the figures of the demonstration that README shows; a slow test holds README to a run."""

from __future__ import annotations

import pytest

from docs.generate.demo_figures import README, SENTENCES, excerpt, figures_of, shown
from docs.generate.example_figures import ROOT, with_figures


@pytest.fixture(scope="module")
def printed() -> str:
    return shown(README.read_text(encoding="utf-8"))


@pytest.mark.parametrize(("page", "sentence"), SENTENCES, ids=[page for page, _ in SENTENCES])
def test_a_page_states_the_figures_that_readme_shows(printed: str, page: str, sentence: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert with_figures(text, sentence, figures_of(printed)) == text, (
        "run python -m docs.generate.demo_figures"
    )


def test_another_figure_of_the_run_is_noticed(printed: str) -> None:
    figures = figures_of(printed.replace("79.99328   0.00076", "79.99328   0.00126"))
    assert figures["focal_length_um"] == pytest.approx(1.26)
    page, sentence = SENTENCES[0]
    text = (ROOT / page).read_text(encoding="utf-8")
    assert "c to 1.3 µm" in with_figures(text, sentence, figures)


def test_readme_leaves_out_what_it_replaces_by_an_ellipsis() -> None:
    lines = (
        "Wrote results/demo", "", "456 images, 84 control points", "parameter true", "", "unknowns  RMS",
        "", "The flight is accepted.", "", "RMS  10.1", "mean  0.0", "",
        "Control points (not independent) [m]", "RMS  9.1", "", "largest  40.4   40.8", "",
        "published  0.029", "", "The result agrees", "Certificate: page", "", "real 2m",
    )  # fmt: skip
    assert excerpt("\n".join(lines)).split("\n") == [
        "456 images, 84 control points", "parameter true", "", "The flight is accepted.", "", "RMS  10.1", "",
        "largest  40.4   40.8", "", "…", "", "The result agrees", "Certificate: page", "",
    ]  # fmt: skip
