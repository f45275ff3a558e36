"""Positions without fixed ambiguities: weighted or excluded as declared, and always reported."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from tasks.formats.records import ExposureRecords
from tasks.formats.trajectory_records import SOLUTIONS
from tasks.settings.inputs import ExposuresInput

# Names that a message lists.
_EXAMPLES = 5


def with_declared_solutions(records: ExposureRecords, source: ExposuresInput) -> ExposureRecords:
    """The exposures with the σ declared for their kind of solution, or without a position."""
    if records.solution is None:
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
    names = ", ".join(str(image[int(row)]) for row in rows[:_EXAMPLES])
    return (
        f"{len(rows):,} positions of {solution} solutions ({names}{', …' if len(rows) > _EXAMPLES else ''})"
    )


def _undeclared(solution: str, sigma: np.typing.NDArray[np.float64]) -> str:
    largest = np.nanmax(sigma) if np.isfinite(sigma).any() else np.nan
    stated = "the file states no σ" if np.isnan(largest) else f"the file states σ up to {largest:.2f} m"
    return f'are used, {stated}; otherwise declare solutions.{solution} = SIGMA or "leave-out"'
