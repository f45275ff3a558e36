"""Inputs that somebody has damaged, by a slip or on purpose: one change to a delivered block or option."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import dist
from pathlib import Path

from hypothesis import strategies as st

from tests.flows.conftest import write_block

CAMERA = """<?xml version="1.0" encoding="UTF-8"?>
<sensor>
<name>C</name>
<usefull-frame><rect><x>0</x><y>0</y><w>10000</w><h>8000</h></rect></usefull-frame>
<pixel_size>5e-06</pixel_size>
<focal><pt3d><x>5000</x><y>4000</y><z>10000</z></pt3d></focal>
</sensor>
"""
CALIBRATION = "calibration.json"
#: A project whose camera comes from a registry, and that registry.
REGISTERED, REGISTRY = "registered.toml", "registry.sqlite"
#: What the project has beyond the synthetic block: flights, times, rates, forward distortion, distances.
_ADDED = {
    'reference = "grid" }': 'reference = "grid", rate_axes = "forward-right-down" }',
    "[inputs.image_points]": """[cameras.C.additional_parameters]
"brown-forward:k1" = 1e-4
[inputs]
images_without_exposure = "orient"
[inputs.image_points]""",
    "[adjustment]": """[inputs.exposures.flights.b]
part_of = "a"
[inputs.distances]
file = "distances.csv"
unit = "m"
[adjustment]""",
    'free = ["boresight"]': 'free = ["boresight", "time_offset"]\npriors = { time_offset_s = 0.001 }',
}
FILES = ("project.toml", "image_points.csv", "exposures.csv", "control.csv", "distances.csv", "camera.xml")
_INLINE = re.compile(r"columns = .*?principal_point_mm = \[0\.0, 0\.0\]\n", re.DOTALL)
#: What can be exchanged in a text: a number, a word, or a sign.
_TOKEN = re.compile(r"[-+]?\d[\d._]*(?:[eE][-+]?\d+)?|\w+|[^\w\s]")
_NUMBER = re.compile(r"[-+]?\d[\d.]*")


@dataclass(frozen=True)
class Hostile:
    """One change.

    Attributes
    ----------
    what : the kind of change, for messages.
    file : the file it is made to; empty: to the options.
    where, other : places in the file as parts of it, 0 to 1.
    value : what is put there, or the options.
    """

    what: str
    file: str = ""
    where: float = 0.0
    other: float = 0.0
    value: str = ""

    def made_to(self, folder: Path) -> tuple[str, ...]:
        """Make the change in a folder of the block; the options of the command."""
        if not self.file:
            return tuple(self.value.split("\x1f"))
        path = folder / self.file
        path.write_bytes(_CHANGES[self.what](path.read_bytes(), self))
        return ()


def hostile_block(folder: Path) -> Path:
    """The synthetic block with its camera in a file, flights, times and rates; returns the project file."""
    project = write_block(folder)
    exposures = folder / "exposures.csv"
    header, *rows = exposures.read_text().splitlines()
    moved = (
        f"{row},{'ab'[number // 4]},{1000.0 + 8.0 * number},{0.1 * (number % 3)},0.05,-0.02"
        for number, row in enumerate(rows)
    )
    columns = f"{header},flight,time,rate_roll,rate_pitch,rate_yaw"
    exposures.write_text("\n".join([columns, *moved]) + "\n")
    (folder / "distances.csv").write_text(_distances(folder / "control.csv"))
    (folder / "camera.xml").write_text(CAMERA)
    text = _INLINE.sub('file = "camera.xml"\nformat = "ign-xml"\n', project.read_text())
    for where, added in _ADDED.items():
        text = text.replace(where, added)
    project.write_text(text)
    return project


def _distances(control: Path) -> str:
    """Distances between surveyed points that follow each other, the last one to be checked."""
    points = [row.split(",") for row in control.read_text().splitlines()[1:]]
    rows = ["point,other_point,distance,sigma,role"]
    for number, (one, other) in enumerate(pairwise(points)):
        distance = dist(*(tuple(map(float, point[1:4])) for point in (one, other)))
        role = "check" if number == len(points) - 2 else "control"
        rows.append(f"{one[0]},{other[0]},{distance:.4f},0.05,{role}")
    return "\n".join(rows) + "\n"


def place(where: float, count: int) -> int:
    """The number of an item among several that lies at a part, 0 to 1, of them."""
    return max(min(int(where * count), count - 1), 0)


def _exchanged(pattern: re.Pattern[str], content: bytes, change: Hostile) -> bytes:
    text = content.decode()
    # Rows are many and alike: half of the changes meet the first ones, with the header.
    found = list(pattern.finditer(text))[: None if change.other < 0.5 else 40]
    match = found[place(change.where, len(found))]
    new = change.value if pattern is _TOKEN else repr(float(match.group()) * float(change.value))
    return (text[: match.start()] + new + text[match.end() :]).encode("utf-8", "surrogatepass")


def _with_lines(content: bytes, change: Hostile) -> bytes:
    lines = content.split(b"\n")
    one, other = place(change.where, len(lines)), place(change.other, len(lines))
    if change.what == "line lost":
        del lines[one]
    elif change.what == "line twice":
        lines.insert(other, lines[one])
    elif change.what == "lines swapped":
        lines[one], lines[other] = lines[other], lines[one]
    else:
        lines[one] = lines[one][: int(change.other * len(lines[one]))]
    return b"\n".join(lines)


def _with_bytes(content: bytes, change: Hostile) -> bytes:
    start = place(change.where, len(content))
    if change.what == "cut":
        return content[:start]
    if change.what == "bit flipped":
        flipped = bytes([content[start] ^ (1 << int(7.99 * change.other))])
        return content[:start] + flipped + content[start + 1 :]
    return content[:start] + change.value.encode("latin-1") + content[start:]


def _with_table(content: bytes, change: Hostile) -> bytes:
    """A whole column scaled or renamed as another program would, or the rows of few names only."""
    header, *rows = (line.split(",") for line in content.decode().splitlines())
    if change.what == "column renamed":
        for row in rows:
            row[0] = _RENAMED[change.value](row[0])
    elif change.what == "few names":
        kept = [*dict.fromkeys(row[0] for row in rows)][: int(change.value)]
        rows = [row for row in rows if row[0] in kept]
    else:
        column = place(change.where, len(header))
        for row in rows:
            if _NUMBER.fullmatch(row[column]):
                row[column] = repr(float(row[column]) * float(change.value))
    return ("\n".join(",".join(row) for row in (header, *rows)) + "\n").encode()


#: What becomes of names on their way through other programs.
_RENAMED: Mapping[str, Callable[[str], str]] = {
    "decimals": "{}.0".format,
    "extension": "{}.tif".format,
    "accent": "e\u0301{}".format,
    "zeros": lambda name: name.replace("0", ""),
    "blank": " {} ".format,
    "small": str.lower,
}
_CHANGES = {
    "token": lambda content, change: _exchanged(_TOKEN, content, change),
    "factor": lambda content, change: _exchanged(_NUMBER, content, change),
    **dict.fromkeys(("line lost", "line twice", "lines swapped", "line cut"), _with_lines),
    **dict.fromkeys(("cut", "bit flipped", "bytes"), _with_bytes),
    **dict.fromkeys(("column scaled by", "column renamed", "few names"), _with_table),
    "encoding": lambda content, change: content.decode().encode(change.value),
    "line ends": lambda content, change: content.replace(b"\n", change.value.encode()),
    "emptied": lambda _content, _change: b"",
}

_NUMBERS = st.one_of(
    st.sampled_from(
        ["nan", "-inf", "0", "-0.0", "-1", "1e300", "1e-300", "5e-324", "1e9", "1e-9", "0x10", "1e400"]
    ),
    st.sampled_from(
        ["9" * 30, "9" * 300, "9" * 5_000, "1_0", "1,5", "1.", ".", "١", "1e", "--1", str(2**63)]
    ),
    st.floats().map(repr),
    st.integers(-(2**70), 2**70).map(str),
)
_TEXTS = st.one_of(
    st.sampled_from(
        ['""', "[]", "{}", "true", "1979-05-27", '"\\u0000"', "'''", "[[", "]", "=", "../x", "~", "${HOME}"]
    ),
    st.sampled_from(
        [
            "x" * 300,
            "x/" * 3_000,
            "[" * 2_000,
            "a." * 2_000 + "a",
            '"' + "é" * 300 + '"',
            "\\",
            "\x1b[2J",
            ";",
        ]
    ),
    st.text(max_size=8),
)
_VALUES = st.one_of(
    _NUMBERS, _NUMBERS, _TEXTS, st.lists(_NUMBERS, max_size=4).map(lambda items: f"[{', '.join(items)}]")
)
_KEYS = st.sampled_from(
    [
        *(
            "project.name",
            "project.crs",
            "project.heights",
            "cameras.C",
            "cameras.C.mount_deg",
            "cameras.C.lever_arm_m",
        ),
        *(
            "cameras.C.boresight_deg",
            "inputs",
            "inputs.image_points.sigma",
            "inputs.image_points.unit",
            "version",
        ),
        *(
            "inputs.exposures.angles.order",
            "inputs.exposures.sigma.position_m",
            "inputs.exposures.position",
            "gates",
        ),
        *(
            "inputs.control.sigma_m",
            "inputs.control.file",
            "inputs.control.check_points",
            "adjustment.max_iterations",
        ),
        *(
            "adjustment.free",
            "adjustment.rejection",
            "adjustment.rejection.critical_value",
            "adjustment.sigma0",
        ),
        *(
            "adjustment.self_calibration",
            "adjustment.gnss_correlation_s",
            "checks.tie_residual_px",
            "gates.sigma0.max",
        ),
        *(
            "calibration",
            "sweep",
            "certificate",
            "inputs.exposures.0.crs",
            "cameras.C.tiles",
            "cameras.C.calibration",
            "cameras.C.calibration_use",
            "cameras.C.additional_parameters",
            "inputs.images_without_exposure",
            "inputs.exposures.angles.rate_axes",
            "inputs.exposures.flights",
            "adjustment.variance_components_by",
            "adjustment.priors",
            "direct_georeferencing.calibration",
            "nothing",
            "",
            "a.b.c",
        ),
    ]
)
PART = st.floats(0.0, 1.0)
_FILE = st.sampled_from((*FILES, CALIBRATION))
_TABLES = st.sampled_from([name for name in FILES if name.endswith(".csv")])


def _change(
    what: Sequence[str],
    value: st.SearchStrategy[str] | None = None,
    file: st.SearchStrategy[str] = _FILE,
) -> st.SearchStrategy[Hostile]:
    return st.builds(
        Hostile, st.sampled_from(what), file, PART, PART, st.just("") if value is None else value
    )


def tokens(file: st.SearchStrategy[str]) -> st.SearchStrategy[Hostile]:
    """Another number, word or sign in a text file."""
    return _change(["token"], _VALUES, file)


def damage(file: st.SearchStrategy[str]) -> st.SearchStrategy[Hostile]:
    """A file that ends early, has lost its content, or one bit of another value."""
    return _change(["cut", "bit flipped", "emptied"], file=file)


#: Changes to all rows of a delivered table.
_OF_TABLES = st.one_of(
    _change(
        ["column scaled by"],
        st.sampled_from(["-1", "0.3048", "1.000002", "1000", "1e-3", "57.29577951308232", "0.9", "2", "0"]),
        _TABLES,
    ),
    _change(["column renamed"], st.sampled_from([*_RENAMED]), _TABLES),
    _change(["few names"], st.integers(0, 4).map(str), _TABLES),
)
#: Changes to the files of a block and to the options of a command.
HOSTILE = st.one_of(
    _OF_TABLES,
    tokens(_FILE),
    tokens(_FILE),
    _change(
        ["factor"], st.sampled_from(["10", "1e3", "1e-3", "-1", "1.001", "57.29577951308232", "1e12", "0"])
    ),
    _change(["line lost", "line twice", "lines swapped", "line cut"]),
    damage(_FILE),
    _change(
        ["bytes"],
        st.sampled_from(["\x00", "\r", "\xff", "\x1a", '"', "'", "\t", "\x1b", "#", ",", "<", "\n" * 5]),
    ),
    _change(["encoding"], st.sampled_from(["utf-16", "utf-8-sig", "utf-32", "utf-7"])),
    _change(["line ends"], st.sampled_from(["\r", "\r\n", "\n\n", " \r\n"])),
    st.builds(lambda key, value: Hostile("--set", value=f"--set\x1f{key}={value}"), _KEYS, _VALUES),
    st.builds(lambda value: Hostile("--data", value=f"--data\x1f{value}"), _TEXTS.filter(bool)),
)
