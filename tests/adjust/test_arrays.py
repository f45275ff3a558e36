"""The order of whole numbers is that of numpy's sort by several keys."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from adjust.arrays import order_of_numbers

_ROWS = st.integers(0, 60).flatmap(
    lambda n: st.tuples(*(st.lists(st.integers(0, most), min_size=n, max_size=n) for most in (3, 40, 10**6)))
)


@settings(max_examples=60, deadline=None)
@given(_ROWS)
def test_order_of_several_keys_is_that_of_lexsort(rows: tuple[list[int], ...]) -> None:
    keys = [np.array(key, dtype=np.int64) for key in rows]
    for some in (keys, keys[::-1], keys[:1], keys[2:]):
        found = order_of_numbers(*some)
        assert found.dtype == np.int64
        np.testing.assert_array_equal(found, np.lexsort(some))
