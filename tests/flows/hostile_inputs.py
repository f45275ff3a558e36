"""Inputs that somebody has damaged, by a slip or on purpose: one change to a delivered block or option."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
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
FILES = ("project.toml", "image_points.csv", "exposures.csv", "control.csv", "camera.xml")
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
    """The synthetic block with its camera in a file; returns the project file."""
    project = write_block(folder)
    (folder / "camera.xml").write_text(CAMERA)
    camera = 'file = "camera.xml"\nformat = "ign-xml"\n'
    project.write_text(_INLINE.sub(camera, project.read_text()))
    return project


def _at(where: float, count: int) -> int:
    return min(int(where * count), count - 1)


def _exchanged(pattern: re.Pattern[str], content: bytes, change: Hostile) -> bytes:
    text = content.decode()
    # Rows are many and alike: half of the changes meet the first ones, with the header.
    found = list(pattern.finditer(text))[: None if change.other < 0.5 else 40]
    match = found[_at(change.where, len(found))]
    new = change.value if pattern is _TOKEN else repr(float(match.group()) * float(change.value))
    return (text[: match.start()] + new + text[match.end() :]).encode("utf-8", "surrogatepass")


def _with_lines(content: bytes, change: Hostile) -> bytes:
    lines = content.split(b"\n")
    one, other = _at(change.where, len(lines)), _at(change.other, len(lines))
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
    place = _at(change.where, len(content))
    if change.what == "cut":
        return content[:place]
    if change.what == "bit flipped":
        return (
            content[:place] + bytes([content[place] ^ (1 << int(7.99 * change.other))]) + content[place + 1 :]
        )
    return content[:place] + change.value.encode("latin-1") + content[place:]


_CHANGES = {
    "token": lambda content, change: _exchanged(_TOKEN, content, change),
    "factor": lambda content, change: _exchanged(_NUMBER, content, change),
    **dict.fromkeys(("line lost", "line twice", "lines swapped", "line cut"), _with_lines),
    **dict.fromkeys(("cut", "bit flipped", "bytes"), _with_bytes),
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
            "nothing",
            "",
            "a.b.c",
        ),
    ]
)
_PART = st.floats(0.0, 1.0)
_FILE = st.sampled_from((*FILES, CALIBRATION))


def _change(what: Sequence[str], value: st.SearchStrategy[str] | None = None) -> st.SearchStrategy[Hostile]:
    return st.builds(
        Hostile, st.sampled_from(what), _FILE, _PART, _PART, st.just("") if value is None else value
    )


#: Changes to the files of a block and to the options of a command.
HOSTILE = st.one_of(
    _change(["token"], _VALUES),
    _change(["token"], _VALUES),
    _change(
        ["factor"], st.sampled_from(["10", "1e3", "1e-3", "-1", "1.001", "57.29577951308232", "1e12", "0"])
    ),
    _change(["line lost", "line twice", "lines swapped", "line cut"]),
    _change(["cut", "bit flipped", "emptied"]),
    _change(
        ["bytes"],
        st.sampled_from(["\x00", "\r", "\xff", "\x1a", '"', "'", "\t", "\x1b", "#", ",", "<", "\n" * 5]),
    ),
    _change(["encoding"], st.sampled_from(["utf-16", "utf-8-sig", "utf-32", "utf-7"])),
    _change(["line ends"], st.sampled_from(["\r", "\r\n", "\n\n", " \r\n"])),
    st.builds(lambda key, value: Hostile("--set", value=f"--set\x1f{key}={value}"), _KEYS, _VALUES),
    st.builds(lambda value: Hostile("--data", value=f"--data\x1f{value}"), _TEXTS.filter(bool)),
)
