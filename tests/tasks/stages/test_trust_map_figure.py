"""The figures of a trust map against values that are read off its cells."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tasks.results.figures import TrustMapGrid
from tasks.stages.trust_map import trust_map_figure

ORDER = np.random.default_rng(1).permutation(11)
#: The cells are 1 to 11, in no order.
VALUE = ORDER + 1.0


def grid_of(area_cells: int | None = None) -> TrustMapGrid:
    return TrustMapGrid(
        west_m=0.0,
        north_m=0.0,
        cell_m=5.0,
        rows=1,
        columns=11,
        sigma_image_um=3.0,
        added_pairs=0,
        cells=11,
        area_cells=area_cells,
    )


def cells(**changed: np.ndarray) -> pd.DataFrame:
    """A table in which x, y and z of every kind are the values times a number of their own."""
    patterns = ("sigma", "pair_sigma", "relative_sigma", "external", "block_error", "ray_error")
    columns = {
        f"{pattern}_{axis}_m": VALUE * (10 * place + k + 1)
        for place, pattern in enumerate(patterns)
        for k, axis in enumerate("xyz")
    }
    return pd.DataFrame(
        {**columns, "rays": VALUE**2, "uncontrolled": np.zeros(11, dtype=np.int64), **changed}
    )


def test_figures_are_the_values_that_the_share_of_the_cells_does_not_exceed() -> None:
    found = trust_map_figure(cells(), grid_of(), 0.9)
    assert found.sigma_m == (10.0, 20.0, 30.0)
    assert found.pair_sigma_m == (110.0, 120.0, 130.0)
    assert found.block_error_m == (410.0, 420.0, 430.0)
    assert found.ray_error_m == found.external_m == (510.0, 520.0, 530.0)
    assert found.median_sigma_m == (6.0, 12.0, 18.0)
    assert found.relative_sigma_m == (126.0, 132.0, 138.0)
    assert (found.cells, found.unmapped, found.uncontrolled, found.median_rays) == (11, 0.0, 0.0, 36.0)


def test_of_an_even_number_the_median_is_the_smaller_of_the_two_in_the_middle() -> None:
    found = trust_map_figure(cells()[VALUE < 11.0], grid_of(), 0.9)
    assert found.median_sigma_m == (5.0, 10.0, 15.0)
    assert found.relative_sigma_m == (105.0, 110.0, 115.0)


def test_the_median_of_the_differences_is_that_of_the_cells_that_have_one() -> None:
    relative = np.where(VALUE < 10.0, VALUE, np.nan)
    found = trust_map_figure(cells(relative_sigma_z_m=relative), grid_of(), 0.9)
    assert found.relative_sigma_m == (5 * 21.0, 5 * 22.0, 5.0)


@pytest.mark.parametrize(("share", "expected"), [(0.6, 7.0), (0.7, 8.0), (0.8, 9.0), (0.9, 10.0)])
def test_the_largest_effect_is_that_of_a_new_ray_of_the_block_or_of_its_rays(
    share: float, expected: float
) -> None:
    kinds = {
        f"{name}_z_m": np.where(np.mod(VALUE, 3) == remainder, VALUE, np.nan if remainder == 1 else 0.1)
        for remainder, name in enumerate(("external", "block_error", "ray_error"))
    }
    assert trust_map_figure(cells(**kinds), grid_of(), share).external_m[2] == expected


def test_cells_with_an_uncontrolled_coordinate_have_no_largest_effect() -> None:
    uncontrolled = np.where(VALUE == 1.0, 1, 0)
    found = trust_map_figure(cells(uncontrolled=uncontrolled), grid_of(), 0.8)
    assert found.external_m == (510.0, 520.0, 530.0)
    assert found.ray_error_m == (459.0, 468.0, 477.0)
    assert found.uncontrolled == pytest.approx(1.0 / 11.0)
    assert trust_map_figure(cells(uncontrolled=uncontrolled), grid_of(), 1.0).external_m == (None,) * 3


def test_cells_of_the_area_that_are_not_mapped_count_as_the_largest() -> None:
    uncontrolled = np.where(VALUE == 1.0, 1, 0)
    found = trust_map_figure(cells(uncontrolled=uncontrolled), grid_of(area_cells=14), 0.75)
    assert found.unmapped == pytest.approx(3.0 / 14.0)
    assert found.uncontrolled == pytest.approx(1.0 / 11.0)
    assert found.sigma_m == (11.0, 22.0, 33.0)
    assert found.median_sigma_m == (6.0, 12.0, 18.0)
    assert trust_map_figure(cells(), grid_of(area_cells=14), 0.8).sigma_m == (None,) * 3
