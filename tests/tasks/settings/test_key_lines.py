from __future__ import annotations

import pytest

from tasks.settings.key_lines import line_of_key

TEXT = """\
# a comment
version = 1
a.b.c = 2

[table]
key = "x" # key2 = 3
"quoted key" = 1
inner = { one = 1,
  two = 2 }
[[list]]
value = 1
[[list]]
value = 2
[list.below]
deep = 3
[table."x.y"]
z = 1
"""


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        (("version",), 2),
        (("a", "b", "c"), 3),
        (("table", "key"), 6),
        (("table", "quoted key"), 7),
        (("table", "inner", "two"), 8),
        (("list", 0, "value"), 11),
        (("list", 1, "value"), 13),
        (("list", 1, "below", "deep"), 15),
        (("table", "missing"), 5),
        (("table", "x.y", "z"), 17),
        (("nothing",), None),
    ],
)
def test_the_line_of_a_key_or_of_the_table_around_it(keys, line):
    assert line_of_key(TEXT, keys) == line
