"""A simulated flight whose names try to become markup, commands or paths wherever they are shown."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

from tasks.files.toml_text import toml_text
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project

#: What each name begins with; every one that HTML, SVG, CSS, typst, a template or a database could take up.
PAYLOADS = (
    '<script>alert("p0wned")</script>',
    '"><img src=x onerror=alert("p0wned")>',
    "'><svg/onload=alert('p0wned')>",
    "</title></style></svg></table><script>alert('p0wned')</script>",
    "javascript:alert('p0wned')",
    "<a href=javascript:alert('p0wned')>x</a>",
    "<!-- ]]> <![CDATA[",
    "&lt;script&gt; &#60;b&#62; &amp;",
    "{{ 7 * 7 }} {% raw %} ${7*7}",
    '#read("/etc/passwd") #panic("p0wned") $x$ *b* _i_ @x <x>',
    "'; DROP TABLE calibrations; --",
    "../../../../tmp/p0wned",
    "مصور",
    "w" * 180,
)
#: Sixteen images, more than there are payloads.
SMALL = ("flight.0.exposures=4", "flight.1.exposures=4", "points.count=250")
PROJECT = f"p{PAYLOADS[0]}{PAYLOADS[1]}{PAYLOADS[9]}"
CAMERA = f"c/{PAYLOADS[1]}{PAYLOADS[10]}{PAYLOADS[9]}"
IDENTITY = {"body": PAYLOADS[3], "lens": PAYLOADS[0], "imu": PAYLOADS[9], "mount": PAYLOADS[10]}


def fly(folder: Path) -> Path:
    """The project file of the flight."""
    simulation = load_simulation("uce-high", SMALL)
    file = simulate_project(simulation, folder).project_file
    names = _Names()
    renamed(folder / "image_points.csv", {"image": names.of, "point": names.of})
    renamed(
        folder / "exposures.csv",
        {"image": names.of, "strip": names.of, "flight": names.of, "camera": lambda _: CAMERA},
    )
    renamed(folder / "control.csv", {"point": names.of})
    text = file.read_text(encoding="utf-8")
    old = simulation.camera.name
    text = text.replace(f"[cameras.{old}]", toml_text({"cameras": {CAMERA: {"columns": 1}}}).split("\n")[0])
    text = text.replace(f'name = "{simulation.project.name}"', toml_text({"name": PROJECT}).strip())
    assert f"cameras.{old}" not in text
    file.write_text(f"{text}\n{toml_text({'cameras': {CAMERA: {'identity': IDENTITY}}})}", encoding="utf-8")
    return file


class _Names:
    """Gives every name one of the payloads to begin with, always the same one."""

    def __init__(self) -> None:
        self._given: dict[str, str] = {}

    def of(self, name: str) -> str:
        if name not in self._given:
            self._given[name] = f"{PAYLOADS[len(self._given) % len(PAYLOADS)]}{name}"
        return self._given[name]


def renamed(file: Path, columns: dict[str, Callable[[str], str]]) -> None:
    """Change the names in columns of a CSV file."""
    with file.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    for row in rows:
        for name, change in columns.items():
            if row.get(name):
                row[name] = change(row[name])
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
