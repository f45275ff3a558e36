from __future__ import annotations

from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.settings.load_simulation import load_simulation, preset_names
from tasks.settings.simulation import Simulation


def _written(folder: Path, text: str) -> str:
    path = folder / "spec.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def _refused(source: str, *overrides: str) -> InputError:
    with pytest.raises(InputError) as raised:
        load_simulation(source, overrides)
    return raised.value


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_is_valid_and_names_itself(name: str) -> None:
    simulation = load_simulation(name)
    assert simulation.preset == name
    assert simulation.project.name == name


def test_an_unknown_preset_names_the_nearest_one() -> None:
    error = _refused("uce-lo")
    assert "no preset 'uce-lo'" in error.what
    assert "'uce-low'" in error.remedy


def test_an_unknown_preset_in_a_specification_is_reported_with_the_file(tmp_path: Path) -> None:
    error = _refused(_written(tmp_path, 'preset = "dmc-8"\n'))
    assert error.file is not None
    assert error.entity == "preset"
    assert "'dmc-8cm'" in error.remedy


def test_a_missing_specification_is_said(tmp_path: Path) -> None:
    assert "no such specification" in _refused(str(tmp_path / "none.toml")).what


def test_a_specification_changes_what_it_names_and_nothing_else(tmp_path: Path) -> None:
    source = _written(tmp_path, 'preset = "uce-low"\nseed = 7\n[noise]\nimage_um = 2.0\n')
    simulation, preset = load_simulation(source), load_simulation("uce-low")
    assert simulation.seed == 7
    assert simulation.noise.image_um == 2.0
    changed = {"seed": 7, "noise": preset.noise.model_copy(update={"image_um": 2.0})}
    assert simulation == preset.model_copy(update=changed)


def test_a_single_table_changes_all_groups_of_the_preset(tmp_path: Path) -> None:
    source = _written(tmp_path, 'preset = "uce-low"\n[flight]\nheight_m = 900.0\n')
    groups = load_simulation(source).flight
    assert [group.height_m for group in groups] == [900.0, 900.0]
    assert [group.name for group in groups] == ["E", "N"]


def test_several_tables_replace_the_groups_of_the_preset(tmp_path: Path) -> None:
    text = (
        'preset = "uce-low"\n[[flight]]\nname = "X"\nheight_m = 500\nheading_deg = 10\nexposures = [3, 4]\n'
    )
    (group,) = load_simulation(_written(tmp_path, text)).flight
    assert group.exposures_of_lines == (3, 4)


def test_an_unknown_key_names_its_line_and_the_nearest_one(tmp_path: Path) -> None:
    error = _refused(_written(tmp_path, 'preset = "uce-low"\n[noise]\nimage_mu = 2.0\n'))
    assert error.line == 3
    assert "image_mu" in error.what
    assert "'image_um'" in error.remedy


def test_an_unknown_table_is_refused(tmp_path: Path) -> None:
    error = _refused(_written(tmp_path, 'preset = "uce-low"\n[terrein]\nrelief_m = 2.0\n'))
    assert "'terrain'" in error.remedy


def test_values_are_set_from_the_command_line_and_only_where_there_is_a_key() -> None:
    simulation = load_simulation("uce-low", ["noise.level=0", "flight.1.lines=9", "control.control=10"])
    assert simulation.noise.level == 0
    assert simulation.control[0].control == 10
    assert "'level'" in _refused("uce-low", "noise.levle=0").remedy
    assert "number" in _refused("uce-low", "flight.height_m=3").remedy


def test_the_seed_of_the_command_line_beats_the_file(tmp_path: Path) -> None:
    assert load_simulation(_written(tmp_path, 'preset = "uce-low"\nseed = 3\n'), seed=9).seed == 9


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        (["project.crs=EPSG:25832"], "location of the block"),
        (["project.latitude_deg=48", "project.longitude_deg=9"], "no location on the earth"),
        (["flight.1.lines=5"], "numbers of exposures"),
        (["flight.1.name=E"], "same name"),
        (["control.layout=perimeter"], "needs count"),
        (["control.control=3", "control.check_fraction=0.5"], "exclude each other"),
        (["project.angles=omega-phi-kappa", "noise.ins_deg=[0.001, 0.02, 0.008]"], "depend on the heading"),
        (["truth.gnss_shift_of_flight_m={ 2 = [0.1, 0.0, 0.0] }"], "which does not exist"),
    ],
)
def test_contradictions_are_refused_in_a_sentence(changes: list[str], what: str) -> None:
    error = _refused("uce-low", *changes)
    assert what in error.what
    assert error.remedy


def test_a_specification_needs_no_preset(tmp_path: Path) -> None:
    text = """
[project]
name = "own"
[camera]
name = "C"
columns = 9000
rows = 12000
pixel_um = 6.0
focal_length_mm = 80.0
[flight]
name = "L"
height_m = 1000.0
heading_deg = 0.0
lines = 2
exposures = 4
[points]
count = 100
[noise]
image_um = 1.5
"""
    simulation = load_simulation(_written(tmp_path, text))
    assert isinstance(simulation, Simulation)
    assert simulation.preset is None
    assert "[camera]" not in str(simulation.control)
    error = _refused(_written(tmp_path, text.replace("[points]\ncount = 100\n", "")))
    assert "'points' is missing" in error.what


@pytest.mark.parametrize(
    "override",
    [
        "points.count=1000000000000",
        "flight.0.lines=1000000000",
        "flight.0.exposures=1000000000",
        "flight.0.exposures=[50000, 50000, 50000, 50000, 1, 1, 1]",
        "control.columns=1000000000",
        "noise.image_um=1e12",
    ],
)
def test_a_simulation_beyond_every_block_is_refused(override: str) -> None:
    what = _refused("uce-low", override).what
    assert "more than" in what or "less than or equal to" in what
