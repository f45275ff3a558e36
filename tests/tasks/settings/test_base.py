from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import Field

from tasks.errors import InputError
from tasks.settings.base import InputPath, Settings
from tasks.settings.coordinates import Heights, LinearAlteration
from tasks.settings.project import ProjectSettings


class Sample(Settings):
    path: InputPath
    several: tuple[InputPath, ...] = ()
    number: float = 1.0
    names: dict[str, int] = Field(default_factory=dict)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "input.txt"
    path.write_bytes(b"content")
    return path


def test_moving_a_file_keeps_the_key_and_changing_a_byte_changes_it(file, tmp_path):
    before = Sample(path=file).key_content()
    moved = tmp_path / "moved.txt"
    file.rename(moved)
    assert Sample(path=moved).key_content() == before
    moved.write_bytes(b"Content")
    assert Sample(path=moved).key_content() != before


def test_no_path_stands_in_the_key(file, tmp_path):
    assert str(tmp_path) not in str(Sample(path=file, several=(file,)).key_content())


def test_the_order_of_names_does_not_matter_but_that_of_files_does(file, tmp_path):
    other = tmp_path / "other.txt"
    other.write_bytes(b"other")
    one = Sample(path=file, names={"a": 1, "b": 2}, several=(file, other)).key_content()
    assert one == Sample(path=file, names={"b": 2, "a": 1}, several=(file, other)).key_content()
    assert one != Sample(path=file, names={"a": 1, "b": 2}, several=(other, file)).key_content()


def test_the_name_of_a_project_is_not_in_its_key(file):
    def key(name, **heights):
        return ProjectSettings(name=name, crs="EPSG:2154", heights=Heights(**heights)).key_content()

    assert key("a", geoid=None) == key("b", geoid=None)
    assert key("a", geoid=None) != key("a", geoid=file)
    alteration = LinearAlteration(ground_m=3.0)
    assert key("a", geoid=file) != key("a", geoid=file, linear_alteration=alteration)


def test_input_files_are_found_at_every_depth(file, tmp_path):
    other = tmp_path / "other.txt"
    other.write_bytes(b"other")
    assert Sample(path=file, several=(other, file)).input_files() == (file, other, file)
    project = ProjectSettings(name="a", crs="EPSG:2154", heights=Heights(geoid=other))
    assert project.input_files() == (other,)


def test_a_file_that_vanished_is_an_input_error(file):
    sample = Sample(path=file)
    file.unlink()
    with pytest.raises(InputError, match="does not exist"):
        sample.key_content()


def test_settings_cannot_be_changed(file):
    sample = Sample(path=file)
    with pytest.raises(ValueError, match="frozen"):
        sample.number = 2.0


def test_a_relative_path_without_a_project_starts_at_the_working_folder(file, monkeypatch):
    monkeypatch.chdir(file.parent)
    assert Sample.model_validate({"path": "input.txt"}).path == Path(file)
