"""The flight check: a sound program agrees with the truth, and a wrong truth is noticed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from flows.stories.flight_check import flight_check
from tasks.errors import InputError
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.truth_comparison import compare_with_truth

SMALL = ("points.count=400",)


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("flight")
    return folder, flight_check(load_simulation("uce-high", SMALL), folder)


def test_every_estimate_agrees_with_the_truth(checked) -> None:
    _, check = checked
    assert check.comparison is not None
    assert check.comparison.contradictions() == ()
    kinds = {item.kind: item for item in check.comparison.kinds}
    assert kinds["positions"].number == 3 * 28
    assert {item.parameter for item in check.comparison.parameters} >= {"boresight_roll", "gnss_shift_z"}


def test_what_was_tested_is_said_with_its_limits(checked) -> None:
    comparison = checked[1].comparison
    said = comparison.agreement()
    assert f"parameter is {max(abs(item.t) for item in comparison.parameters):.1f} σ (4 σ allowed)" in said
    for item in comparison.kinds:
        assert f"{item.kind} {item.pooled:.2f} (0." in said


def test_a_parameter_that_is_not_the_true_one_is_named(checked) -> None:
    _, check = checked
    first = check.comparison.parameters[0]
    moved = replace(first, true=first.true + 5.0 * first.sigma)
    wrong = replace(check.comparison, parameters=(moved,))
    (sentence,) = wrong.contradictions()
    assert first.parameter in sentence


def test_standard_deviations_that_promise_too_much_are_named(checked) -> None:
    """The σ of the results divided by two must look like errors twice as large."""
    folder, check = checked
    results = folder / "results"
    table = pq.read_table(results / "exterior_orientations.parquet").to_pandas()
    for column in ("sigma_x_m", "sigma_y_m", "sigma_z_m"):
        table[column] /= 2.0
    (folder / "optimistic").mkdir()
    for name in ("object_points.parquet", "parameters.parquet", "correlations.parquet"):
        (folder / "optimistic" / name).write_bytes((results / name).read_bytes())
    table.to_parquet(folder / "optimistic" / "exterior_orientations.parquet")
    found = compare_with_truth(folder, folder / "optimistic")
    assert any("positions" in sentence for sentence in found.contradictions())
    pooled = {item.kind: item.pooled for item in check.comparison.kinds}
    assert {item.kind: item.pooled for item in found.kinds}["positions"] == pytest.approx(
        2 * pooled["positions"]
    )


def test_a_project_without_truth_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no true values"):
        compare_with_truth(tmp_path, tmp_path / "results")
