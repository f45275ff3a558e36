"""What DBAT, the Damped Bundle Adjustment Toolbox (Börlin and Grussenmeyer), prints and reads.

Its measurements are x to the right and y downward from the upper left corner of the image; the principal
point (px, py) counts from the same corner in mm, y downward.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

_TABLES = ("Ctrl measurements", "Check measurements")
_POSTERIOR = ("x", "y", "z", "stdx", "stdy", "stdz")
_DIFFERENCE = ("x", "y", "z")
_PARTS = {"Prior": "prior", "Posterior": "posterior", "Diff (pos=abs diff, std=rel diff)": "difference"}


@dataclass(frozen=True)
class Printed:
    """A value and its standard deviation as the report prints them; '' where it prints none."""

    value: str
    deviation: str


@dataclass(frozen=True, eq=False)
class Report:
    """DBAT's report: figures by label, camera parameters and orientations by label, surveyed points.

    ``points`` has one row for each control and check point: kind, point, and as printed the adjusted
    position x, y, z with stdx, stdy, stdz and the adjusted minus the given one dx, dy, dz.
    """

    figures: dict[str, str]
    camera: dict[str, Printed]
    photos: tuple[dict[str, Printed], ...]
    points: pd.DataFrame
    lines: tuple[str, ...]

    def figure(self, pattern: str) -> str:
        """The first group of the first line that a regular expression fits."""
        return next(found[1] for line in self.lines if (found := re.search(pattern, line)))

    def correlations(self, label: str, other: str) -> list[str]:
        """Of each photo, the correlation that is printed between two of its parameters; '' for none."""
        found = [""] * len(self.photos)
        photo, parameter = -1, ""
        for line in self.lines:
            photo += bool(re.match(r"Photo \d+:", line))
            parameter = line.removesuffix(":") if line.endswith(":") else parameter
            if parameter == label and (text := re.search(rf"{other}:(-?[\d.]+%)", line)):
                found[photo] = text[1]
        return found


def read_report(path: Path) -> Report:
    """The report of one run."""
    lines = [line.strip() for line in path.read_text().splitlines()]
    figures = {
        label: line.removeprefix(label).lstrip(": ").split()[0]
        for label in ("Sigma0 (pixels)", "Sigma0", "Redundancy", "Number of observations", "Last error")
        for line in lines
        if re.match(rf"{re.escape(label)}(:| +\d)", line)
    }
    start = next(i for i, line in enumerate(lines) if line.startswith("Camera1"))
    photos = [i for i, line in enumerate(lines) if re.match(r"Photo \d+:", line)]
    end = next(i for i, line in enumerate(lines) if line == "Quality")
    return Report(
        figures,
        _printed(lines[start : photos[0]]),
        tuple(_printed(lines[i:j]) for i, j in zip(photos, [*photos[1:], end], strict=True)),
        _surveyed(lines[end:]),
        tuple(lines),
    )


def _printed(lines: list[str]) -> dict[str, Printed]:
    """Labels, each with the value and the deviation on the lines after it."""
    result: dict[str, Printed] = {}
    label = ""
    for line in lines:
        key, _, rest = line.partition(":")
        if key == "Value":
            result[label] = Printed(rest.split()[0], "")
        elif key == "Deviation":
            result[label] = Printed(result[label].value, rest.split()[0])
        else:
            label = key.split(" - ")[0]
    return result


def _surveyed(lines: list[str]) -> pd.DataFrame:
    """The rows of control and check points."""
    rows: dict[tuple[str, str], dict[str, str]] = {}
    kind, part = "", ""
    for line in lines:
        kind = {"Ctrl measurements": "control", "Check measurements": "check"}.get(line, kind)
        part = _PARTS.get(line, part if "," in line else "")
        fields = [text.strip() for text in line.split(",")]
        if kind and part in ("posterior", "difference") and fields[0].isdigit():
            row = rows.setdefault((kind, fields[0]), {"kind": kind, "point": fields[0]})
            names = _POSTERIOR if part == "posterior" else tuple(f"d{name}" for name in _DIFFERENCE)
            row.update(zip(names, fields[1:], strict=False))
    return pd.DataFrame(rows.values())


def script_marks(path: Path) -> pd.DataFrame:
    """Image points of a script: point, image, x, y."""
    table = pd.read_csv(path, comment="#", header=None, names=["point", "image", "x", "y"])
    return table[["image", "point", "x", "y"]]


def photomodeler_marks(path: Path) -> pd.DataFrame:
    """Image points of a text export of PhotoModeler: its lines of six numbers; images count from 1."""
    lines = (line.split() for line in path.read_text().splitlines())
    rows = [[int(row[0]) + 1, int(row[1]), float(row[2]), float(row[3])] for row in lines if len(row) == 6]
    return pd.DataFrame(
        [row for row in rows if np.isfinite(row[2])], columns=["image", "point", "x", "y"]
    ).astype({"image": int, "point": int})
