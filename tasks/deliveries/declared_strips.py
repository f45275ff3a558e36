"""Camera, flight and strips of exposures as declared in the project file, overriding those of the file."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow as pa

from tasks.errors import Location
from tasks.formats.records import ExposureRecords
from tasks.settings.inputs import ExposuresInput

_PARTS = re.compile(r"\{strip\}|\{flight\}|\*|\?|.", re.DOTALL)


def with_declared_names(records: ExposureRecords, source: ExposuresInput) -> ExposureRecords:
    """The exposures with the declared camera and flight, and with the strips that the declared rule finds.

    Raises
    ------
    InputError
        If strips are to be found by time and an exposure has none, or by name and one is made otherwise.
    """
    count = len(records.line)
    if source.camera is not None:
        records = replace(records, camera=pa.array([source.camera] * count, pa.string()))
    if source.flight is not None:
        records = replace(records, flight=pa.array([source.flight] * count, pa.string()))
    if source.strip is None:
        return records
    if source.strip.pattern is not None:
        return _strips_of_names(records, source.strip.pattern, keep_flight=source.flight is not None)
    assert source.strip.gap_factor is not None  # the settings have one of both
    return _strips_of_times(records, source.strip.gap_factor)


def expression_of(pattern: str) -> re.Pattern[str]:
    """A regular expression for a pattern of names; each part ends before the character that follows it."""
    parts = _PARTS.findall(pattern)
    text = ""
    for part, after in zip(parts, [*parts[1:], ""], strict=True):
        if part in ("{strip}", "{flight}", "*"):
            any_of_it = f"[^{re.escape(after)}]+" if after else ".+"
            text += any_of_it if part == "*" else f"(?P<{part[1:-1]}>{any_of_it})"
        else:
            text += "." if part == "?" else re.escape(part)
    return re.compile(text, re.DOTALL)


def _strips_of_names(records: ExposureRecords, pattern: str, *, keep_flight: bool) -> ExposureRecords:
    expression = expression_of(pattern)
    found = [expression.fullmatch(name) for name in records.image.to_pylist()]
    row = next((k for k, one in enumerate(found) if one is None), None)
    if row is not None:
        others = sum(one is None for one in found)
        raise Location(records.file, int(records.line[row]), str(records.image[row])).error(
            f"The name of the image does not match the pattern '{pattern}' ({others} of {len(found)}).",
            "Correct strip.pattern of this input.",
        )
    parts = [one.groupdict() for one in found if one is not None]
    strips = pa.array([part["strip"] for part in parts], pa.string())
    if "flight" not in expression.groupindex or keep_flight:
        return replace(records, strip=strips)
    return replace(records, strip=strips, flight=pa.array([part["flight"] for part in parts], pa.string()))


def _strips_of_times(records: ExposureRecords, factor: float) -> ExposureRecords:
    time = records.time_s
    if np.isnan(time).any():
        row = int(np.argmax(np.isnan(time)))
        raise Location(records.file, int(records.line[row]), str(records.image[row])).error(
            'Strips are defined by time gaps (strip = "time-gaps"), but this exposure has no time.',
            'Give it, or define strips by name: strip = { pattern = "{strip}_*" }.',
        )
    # Heads of a multi-head system expose together: an interval is one between different times.
    flight = records.flight.fill_null("").to_pylist()
    table = pd.DataFrame({"flight": flight, "time": time})
    moments = table.drop_duplicates().sort_values(["flight", "time"], kind="stable")
    step = moments.groupby("flight", sort=False)["time"].diff()
    new = step.isna() | (step > factor * step.median())
    moments["strip"] = new.groupby(moments["flight"], sort=False).cumsum().astype(int)
    numbers = table.merge(moments, on=["flight", "time"], how="left", validate="many_to_one")["strip"]
    return replace(records, strip=pa.array([str(number) for number in numbers], pa.string()))
