from __future__ import annotations

from pathlib import Path

from docs.generate.settings import _TABLES, project_file_page
from tasks.settings.base import Settings, meaning_of
from tasks.settings.table_layout import TableSettings

PAGE = Path(__file__).resolve().parents[3] / "docs" / "project-file.md"


def test_the_committed_page_is_up_to_date():
    message = "run `python -m docs.generate.settings` and commit docs/project-file.md"
    assert PAGE.read_text(encoding="utf-8") == project_file_page(), message


def test_every_key_of_every_table_is_explained():
    for _, model, _ in _TABLES:
        for name in model.model_fields:
            assert meaning_of(model, name), f"{model.__name__}.{name}"


def test_no_settings_model_is_left_out():
    def models(model):
        yield model
        for field in model.model_fields.values():
            for found in _settings_in(field.annotation):
                yield from models(found)

    from tasks.settings.project import Project

    # The layout of tables is no table of its own: its keys stand in the inputs, and in `table` of a camera.
    own = {model for model in models(Project) if model.model_fields.keys() - TableSettings.model_fields}
    assert {model for _, model, _ in _TABLES} - {TableSettings} == own


def _settings_in(annotation):
    import typing

    if isinstance(annotation, type) and issubclass(annotation, Settings):
        return [annotation]
    return [found for item in typing.get_args(annotation) for found in _settings_in(item)]
