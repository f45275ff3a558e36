"""Columns of numbers as one array."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tasks.tables.number_columns import numbers_of

TABLE = pd.DataFrame({"name": ["a", "b"], "x": [1.5, np.nan], "n": [3, 4]})


@pytest.mark.parametrize("rows", [0, 1, 2])
@pytest.mark.parametrize("columns", [["x"], ["n", "x"]])
def test_values_are_those_of_the_columns_in_their_order(rows, columns):
    own = TABLE.head(rows)
    expected = own[columns].to_numpy(np.float64)
    values = numbers_of(own, columns)
    np.testing.assert_array_equal(values, expected)
    # Another layout in memory would have kernels compiled again.
    assert (values.dtype, values.strides) == (expected.dtype, expected.strides)


def test_texts_are_no_numbers_and_a_missing_column_is_named():
    with pytest.raises(ValueError, match="could not convert"):
        numbers_of(TABLE, ["x", "name"])
    with pytest.raises(KeyError, match="z"):
        numbers_of(TABLE, ["x", "z"])
