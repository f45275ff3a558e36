"""What the project file declares of delivered exposures, overriding their file.

Camera, flight and strips; parts of one flight, and cameras that were remounted; how positions without fixed
ambiguities are weighted, or that they are excluded, which is always reported.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from tasks.errors import Location
from tasks.formats.records import ExposureRecords
from tasks.formats.trajectory_records import SOLUTIONS
from tasks.nearest_name import did_you_mean
from tasks.plain_text import some_of
from tasks.settings.inputs import DeliveredFlight, ExposuresInput

#: Exposures within this time are of one moment, s: signals of several heads.
ONE_MOMENT_S = 1e-3
# Names that a message lists.


def with_declared_solutions(records: ExposureRecords, source: ExposuresInput) -> ExposureRecords:
    """The exposures with the σ declared for their kind of solution, or without a position.

    Raises
    ------
    InputError
        If the project declares the use of kinds and the file states none.
    """
    if records.solution is None:
        if source.solutions:
            raise Location(records.file).error(
                "solutions declares the use of positions by the kind of their GNSS solution, but the file "
                "states none.",
                "Leave solutions out of this input.",
            )
        return records
    position, sigma = records.position.copy(), records.sigma_position.copy()
    remarks: list[str] = []
    for solution in SOLUTIONS:
        rows = np.flatnonzero(pc.fill_null(pc.equal(records.solution, solution), False).to_numpy(False))
        rows = rows[np.isfinite(position[rows]).all(axis=1)]
        use = source.solutions.get(solution)  # type: ignore[call-overload]
        if len(rows) == 0 or (solution == "fixed" and use is None):
            continue
        if use is None:
            done = _undeclared(solution, sigma[rows])
        elif use == "leave-out":
            position[rows] = np.nan
            done = "are excluded, as declared"
        else:
            sigma[rows] = use
            done = f"have σ {', '.join(f'{value:g}' for value in use)} m, as declared"
        remarks.append(f"{records.file.name}: {_listed(records.image, rows, solution)} {done}.")
    return replace(records, position=position, sigma_position=sigma, remarks=(*records.remarks, *remarks))


def _listed(image: pa.Array, rows: np.typing.NDArray[np.integer], solution: str) -> str:
    return f"{len(rows):,} positions of {solution} solutions ({some_of(image.take(pa.array(rows)))})"


def _undeclared(solution: str, sigma: np.typing.NDArray[np.float64]) -> str:
    largest = np.nanmax(sigma) if np.isfinite(sigma).any() else np.nan
    stated = "the file states no σ" if np.isnan(largest) else f"the file states σ up to {largest:.2f} m"
    return f'are used, {stated}; otherwise declare solutions.{solution} = SIGMA or "leave-out"'


def with_declared_flights(
    records: ExposureRecords, declared: Mapping[str, DeliveredFlight]
) -> ExposureRecords:
    """The exposures with their declared flights and cameras; strips of a part are prefixed with its name.

    Raises
    ------
    InputError
        If no exposure is of a flight that is declared.
    """
    camera, strip, flight = records.camera, records.strip, records.flight
    for name, own in declared.items():
        mine = pc.fill_null(pc.equal(records.flight, name), False)
        if not pc.any(mine).as_py():
            names = sorted(pc.unique(records.flight.drop_null()).to_pylist())
            known = f"Its flights are: {', '.join(names)}." if names else "It names no flights."
            raise Location(records.file, entity=name).error(
                f"inputs.exposures.flights declares the flight '{name}', but the file contains no "
                "exposure of it.",
                f"{known} {did_you_mean(name, names)}".strip(),
            )
        if own.camera is not None:
            camera = pc.if_else(mine, own.camera, camera)
        if own.part_of is not None:
            strip = pc.if_else(mine, pc.binary_join_element_wise(name, strip, " "), strip)
            flight = pc.if_else(mine, own.part_of, flight)
    return replace(records, camera=camera, strip=strip, flight=flight)


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
    # Heads of a multi-head system expose together: an interval is one between different moments.
    flight = records.flight.fill_null("").to_pylist()
    table = pd.DataFrame({"flight": flight, "time": time})
    moments = table.drop_duplicates().sort_values(["flight", "time"], kind="stable")
    step = moments.groupby("flight", sort=False)["time"].diff()
    new = step.isna() | (step > factor * step[step >= ONE_MOMENT_S].median())
    moments["strip"] = new.groupby(moments["flight"], sort=False).cumsum().astype(int)
    numbers = table.merge(moments, on=["flight", "time"], how="left", validate="many_to_one")["strip"]
    return replace(records, strip=pa.array([str(number) for number in numbers], pa.string()))
