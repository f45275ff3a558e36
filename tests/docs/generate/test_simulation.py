from __future__ import annotations

from pathlib import Path

from docs.generate.simulation import _TABLES, simulation_page
from tasks.settings.base import meaning_of

PAGE = Path(__file__).resolve().parents[3] / "docs" / "simulation.md"


def test_the_committed_page_is_up_to_date() -> None:
    message = "run `python -m docs.generate.simulation` and commit docs/simulation.md"
    assert PAGE.read_text(encoding="utf-8") == simulation_page(), message


def test_every_key_of_every_table_is_explained() -> None:
    for _, model, _ in _TABLES:
        for name in model.model_fields:
            assert meaning_of(model, name), f"{model.__name__}.{name}"
