"""The form of a run: every choice is one the project file knows, and says what it does."""

from __future__ import annotations

import typing
from collections.abc import Callable
from pathlib import Path

import pytest
from pydantic import ValidationError

from flows.server.run_form import AS_GIVEN, RunForm
from tasks.settings.load import load_project

CHOICES = [
    (name, choice)
    for name, field in RunForm.model_fields.items()
    for choice in typing.get_args(field.annotation)
    if isinstance(choice, str) and choice != AS_GIVEN
]


def test_an_untouched_form_changes_nothing() -> None:
    assert RunForm().overrides() == ()


@pytest.mark.parametrize(("name", "choice"), CHOICES)
def test_every_choice_is_one_the_project_file_knows(
    name: str, choice: str, tmp_path: Path, write_project: Callable[..., Path]
) -> None:
    file = write_project(tmp_path)
    overrides = RunForm(**{name: choice}).overrides()
    assert len(overrides) == 1
    assert load_project(file, overrides).adjustment is not None


def test_numbers_reach_the_settings(tmp_path: Path, write_project: Callable[..., Path]) -> None:
    form = RunForm(max_iterations=7, sigma0_limit=1.25, rejection="3.29", robust="huber")
    project = load_project(write_project(tmp_path), form.overrides())
    assert project.adjustment.max_iterations == 7
    assert project.gates.sigma0 is not None
    assert project.gates.sigma0.max == 1.25
    assert project.adjustment.rejection.critical_value == 3.29
    assert project.adjustment.rejection.robust == "huber"


def test_without_rejection_there_is_nothing_to_test(
    tmp_path: Path, write_project: Callable[..., Path]
) -> None:
    form = RunForm(rejection="none", rejection_test="observations")
    project = load_project(write_project(tmp_path), form.overrides())
    assert project.adjustment.rejection.critical_value is None


@pytest.mark.parametrize(
    "wrong",
    [{"datum": "x"}, {"max_iterations": 0}, {"sigma0_limit": -1}, {"sigma0_limit": "nan"}, {"more": 1}],
)
def test_wrong_values_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        RunForm.model_validate(wrong)


def test_every_field_has_a_title_a_description_and_a_default() -> None:
    for name, field in RunForm.model_fields.items():
        assert field.title, name
        assert field.description, name
        assert not field.is_required(), name
