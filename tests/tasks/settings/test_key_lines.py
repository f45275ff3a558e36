from __future__ import annotations

import time

import pytest

from tasks.settings.key_lines import line_nested_deeper, line_of_key

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


VALUES = """\
text = '''
[no.table]
b = 1 ''''
rows = [
  1, # ]
  { c = "]", d = '[' },
]
[table]
"a = [b" = "\\"]" # [c]
k = 1
"""


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        (("text",), 1),
        (("b",), None),
        (("no", "table"), None),
        (("rows", 1, "c"), 4),
        (("table", "a = [b"), 9),
        (("table", "k"), 10),
    ],
)
def test_what_stands_inside_a_value_is_no_key(keys, line):
    assert line_of_key(VALUES, keys) == line


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a.b.c = 1\n[d.e.f]\n", None),
        ("a = 1\nb.c . 'd'.\"e\" = 1", 2),
        ("a = '.....'\n# .....\n[b] # [[[[\nc = [[[]]]", None),
        ("a = [\n[[[1]]]]", 2),
        ("a = 1.5\nb = [1.5, 2.5]\nc.d = 2.5", None),
    ],
)
def test_the_line_that_is_nested_too_deeply(text, line):
    assert line_nested_deeper(text, 3) == line


MANY = 50_000


@pytest.mark.parametrize(
    "text",
    [
        *(
            "[" + " " * MANY,
            "[" + "] " * (MANY // 2),
            "# " + "a" * MANY,
            "-" * MANY,
            "a" * MANY,
        ),
        *('"""' + '\\"' * (MANY // 2), '"' * MANY, "'" * MANY, "\\" * MANY, "\n" * MANY),
        *("a" + ".a" * 29 + "\n", "[[a]]\n", '"\n', "'''\"\"\"", "[a", "a = [\n", "{[", "\u2028"),
    ],
    ids=lambda text: repr(text[:6]),
)
def test_the_time_is_proportional_to_the_text(text):
    text = text * (MANY // len(text))
    begun = time.process_time()
    line_nested_deeper(text, 30)
    line_of_key(text, ("nothing",))
    # Some 0.06 s; with a pattern that goes back it would be minutes.
    assert time.process_time() - begun < 10.0
