"""Published tables are data of the right shape, with the numbers of the print."""

from __future__ import annotations

import pytest

from tasks.errors import InputError
from tasks.settings.load_simulation import load_simulation
from tasks.settings.published_sweep import PublishedPart, published_names, published_table
from tasks.tables.schemas.sweep import SWEEP


@pytest.mark.parametrize("name", published_names())
def test_every_table_has_a_source_and_columns_of_the_sweep(name: str) -> None:
    table = published_table(name)
    assert len(table.source) > 40
    known = {column.name: column.type for column in SWEEP.columns}
    for figures in table.figures.values():
        assert figures
        assert all(known[column] == "float64" for column in figures)
        assert all(0.0 < value < 10.0 for value in figures.values())


def test_the_test_field_has_34_scenarios_and_their_ratios() -> None:
    figures = published_table("uce-2012").figures
    assert len(figures) == 15 + 4 + 3 * 5
    none, full = figures["low", "84/0", "none"], figures["low", "84/0", "bluh:1-12+42-73"]
    assert (none["sigma0_um"], none["rmse_control_z_m"], none["max_control_y_m"]) == (1.15, 0.028, 0.078)
    assert full["sigma0_um"] / none["sigma0_um"] == pytest.approx(0.913, abs=5e-4)
    fewest = figures["both", "5/79", "none"]
    assert (fewest["rmse_check_z_m"], fewest["max_check_z_m"]) == (0.085, 0.278)
    assert ("both", "44/40", "bluh:42-73") not in figures


def test_a_number_that_is_not_printed_does_not_exist() -> None:
    low = published_table("vaihingen-dmc-2008").figures["low", "9 control points", "grid"]
    assert "rmse_control_z_m" not in low
    assert low["rmse_check_z_m"] == 0.041


def test_a_row_that_does_not_fit_its_columns_is_refused() -> None:
    with pytest.raises(ValueError, match="does not fit"):
        PublishedPart(title="t", control="c", columns=("block", "variant"), rows=(("a",),))


@pytest.mark.parametrize("name", ["uce-2012", "dmc-burn-in-2011"])
def test_a_burn_in_is_compared_only_with_a_published_protocol(name: str) -> None:
    with pytest.raises(InputError) as refused:
        load_simulation("dmc-protocol", (f'burn_in.compare_with="{name}"',))
    assert refused.value.what.endswith(f"There is no published burn-in protocol '{name}'.")
    assert refused.value.entity == f'--set burn_in.compare_with="{name}"'
    assert "dmc-burn-in-2010" in str(refused.value.remedy)
