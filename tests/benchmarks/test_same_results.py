"""Two tables are compared number by number."""

from __future__ import annotations

import numpy as np
import pandas as pd

from benchmarks.same_results import difference

TABLE = pd.DataFrame(
    {"point": ["a", "b"], "x_m": [1.0, np.nan], "sigma_x_m": [0.5, np.nan], "mdb": [4.0, 2.0]}
)


def test_a_coordinate_is_compared_in_its_standard_deviation() -> None:
    other = TABLE.assign(x_m=[1.001, np.nan])
    assert np.isclose(difference(TABLE, other)[0], 0.002)
    assert difference(TABLE, other)[1] == "x_m"


def test_what_has_no_standard_deviation_is_compared_with_its_largest() -> None:
    apart, column = difference(TABLE, TABLE.assign(mdb=[4.0, 2.4]))
    assert column == "mdb"
    assert np.isclose(apart, 0.1)


def test_names_and_missing_numbers_are_the_same_or_not() -> None:
    assert difference(TABLE, TABLE) == (0.0, "")
    assert difference(TABLE, TABLE.assign(point=["a", "c"]))[0] == np.inf
    assert difference(TABLE, TABLE.assign(x_m=[1.0, 2.0]))[0] == np.inf
    assert difference(TABLE, TABLE.iloc[:1])[0] == np.inf
