"""The table [sweep]: its short forms, and what is wrong said at its place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.settings.load import load_project, load_variants
from tasks.settings.sweep import BlockSelection, ControlScenario, SweepSettings

Write = Callable[..., Path]

SWEEP = """
[inputs.control]
file = "control.csv"
format = "csv"
crs = "local"
heights = "ellipsoidal"
sigma_m = 0.02
[sweep]
[sweep.blocks]
low = ["low"]
crossing = { strips = ["N*"], height_m = [100, 900] }
[sweep.control]
"2/1" = { count = 2, layout = "border" }
"3/0" = "all"
named = ["a", "b"]
[sweep.variants]
as_it_is = {}
loose = { "inputs.control.sigma_m" = 0.1, adjustment.rejection = "none" }
free = { "adjustment.free" = ["boresight"] }
"""


@pytest.fixture
def write(tmp_path: Path, write_project: Write) -> Callable[[str], Path]:
    def project(more: str = SWEEP) -> Path:
        path = write_project(tmp_path, more)
        (tmp_path / "control.csv").write_text("point,x,y,z\na,0,0,0\nb,10,0,0\n")
        return path

    return project


def refusal(path: Path, *overrides: str) -> InputError:
    with pytest.raises(InputError) as raised:
        load_variants(path, overrides)
    return raised.value


def test_lists_and_words_are_short_for_tables(write: Callable[[str], Path]) -> None:
    sweep = load_project(write(SWEEP)).sweep
    assert sweep is not None
    assert sweep.blocks["low"] == BlockSelection(flights=("low",))
    assert sweep.blocks["crossing"] == BlockSelection(strips=("N*",), height_m=(100.0, 900.0))
    assert sweep.control["2/1"] == ControlScenario(count=2, layout="border")
    assert sweep.control["3/0"] == ControlScenario(roles="all")
    assert sweep.control["named"] == ControlScenario(points=("a", "b"))


def test_a_variant_is_the_project_with_the_settings_it_names_changed(write: Callable[[str], Path]) -> None:
    path = write(SWEEP)
    project, variants = load_project(path), load_variants(path)
    assert list(variants) == ["as_it_is", "loose", "free"]
    unchanged = project.model_copy(update={"sweep": None})
    assert variants["as_it_is"] == unchanged
    assert variants["loose"].inputs.control[0].sigma_m == (0.1, 0.1, 0.1)
    assert variants["loose"].adjustment.rejection.critical_value is None
    assert variants["free"].adjustment.free == ("boresight",)
    assert variants["free"].inputs == unchanged.inputs


def test_parameters_are_variants_of_one_setting() -> None:
    sweep = SweepSettings(parameters=("none", "bluh:1-12"), variants={"free": {"adjustment": {"free": []}}})
    key = "adjustment.self_calibration.parameters"
    assert sweep.changes() == {
        "none": {key: "none"},
        "bluh:1-12": {key: "bluh:1-12"},
        "free": {"adjustment.free": []},
    }


def test_without_a_table_there_is_one_scenario_of_everything_as_delivered() -> None:
    sweep = SweepSettings()
    assert sweep.blocks == {"all": BlockSelection()}
    assert sweep.control == {"delivered": ControlScenario(roles="delivered")}
    assert sweep.changes() == {"as in the project": {}}


def test_the_sweep_is_no_part_of_the_settings_of_a_run(write: Callable[[str], Path]) -> None:
    with_sweep = load_project(write(SWEEP))
    assert with_sweep.key_content() == with_sweep.model_copy(update={"sweep": None}).key_content()
    sweep = with_sweep.sweep
    assert sweep is not None
    assert sweep.key_content() == sweep.model_copy(update={"workers": 3}).key_content()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"inputs.control.sigma_m"', '"inputs.control.sigma"', "'sigma_m'"),
        ('"adjustment.free"', '"adjustmnt.free"', "'adjustment'"),
        ('["boresight"]', '["boresite"]', "boresite"),
        ('"3/0" = "all"', '"3/0" = "every"', "delivered"),
        ("count = 2", "cont = 2", "'count'"),
        (
            '{ count = 2, layout = "border" }',
            '{ layout = "border" }',
            "The choice of control points is not valid",
        ),
        ("[sweep.blocks]", "[sweep.block]", "'blocks'"),
        ("[sweep]\n", '[sweep]\ncompare_with = "uce-2021"\n', "'uce-2012'"),
        ("[sweep]\n", '[sweep]\nparameters = ["loose"]\n', "two variants 'loose'"),
        ("[sweep]\n", "[sweep]\nworkers = 0\n", "greater than or equal to 1"),
    ],
)
def test_what_is_wrong_is_named_with_a_remedy_and_its_line(
    write: Callable[[str], Path], old: str, new: str, words: str
) -> None:
    assert old in SWEEP
    error = refusal(write(SWEEP.replace(old, new)))
    assert words in str(error)
    assert error.file is not None
    assert error.line is not None
    assert "sweep" in str(error.entity)


def test_a_variant_that_is_wrong_is_named(write: Callable[[str], Path]) -> None:
    text = SWEEP.replace('"adjustment.free"', '"adjustment.fre"')
    error = refusal(write(text))
    assert error.entity == "sweep.variants.free"
    assert error.what == "Variant 'free': adjustment.fre: there is no key 'fre' in adjustment."
    assert error.line is not None
    assert (write(text)).read_text().splitlines()[error.line - 1].startswith("free =")


def test_a_project_without_a_sweep_is_told_so(write: Callable[[str], Path]) -> None:
    assert "no table [sweep]" in refusal(write("")).what
