"""Results of a simulated project compared with its truth.

Each estimate is compared with its own standard deviation: t = (estimated − true)/σ for a parameter, and
for many unknowns of one kind the pooled ratio √mean((e/σ)²), which is 1 when the stated standard
deviations are what they claim to be.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq

from adjust.arrays import Floats
from tasks.errors import InputError
from tasks.simulation.simulation_truth import TRUTH

# A single block is one draw: its unknowns are correlated, so the pooled ratio scatters about 1.
_POOLED_LIMITS = (0.8, 1.2)
# Exceeded once in 16,000 parameters.
_LARGEST_T = 4.0


@dataclass(frozen=True)
class RecoveredParameter:
    """A system parameter beside its truth, in the unit of parameters.parquet."""

    parameter: str
    entity: str
    unit: str
    true: float
    estimated: float
    sigma: float

    @property
    def t(self) -> float:
        """Error over standard deviation."""
        return (self.estimated - self.true) / self.sigma


@dataclass(frozen=True)
class RecoveredKind:
    """All unknowns of one kind beside their truth.

    Attributes
    ----------
    kind : e.g. "positions".
    unit : m or deg.
    number : of scalar unknowns.
    rmse : √mean(e²).
    sigma : √mean(σ²), as stated.
    pooled : √mean((e/σ)²).
    """

    kind: str
    unit: str
    number: int
    rmse: float
    sigma: float
    pooled: float


@dataclass(frozen=True)
class TruthComparison:
    """What an adjustment made of a block whose truth is known."""

    parameters: tuple[RecoveredParameter, ...]
    kinds: tuple[RecoveredKind, ...]

    def contradictions(self) -> tuple[str, ...]:
        """Sentences about what does not agree with the truth within its own standard deviation."""
        low, high = _POOLED_LIMITS
        found = [
            f"{item.parameter} of {item.entity} is wrong by {item.t:+.1f} of its standard deviation."
            for item in self.parameters
            if not abs(item.t) <= _LARGEST_T
        ]
        found += [
            f"The errors of the {item.kind} are {item.pooled:.2f} times their standard deviations; "
            f"{low:g} to {high:g} is expected."
            for item in self.kinds
            if not low <= item.pooled <= high
        ]
        return tuple(found)


def compare_with_truth(project: Path, results: Path) -> TruthComparison:
    """Compare the published results of a simulated project with the truth beside it.

    Parameters
    ----------
    project : folder of the simulated project, with ``truth/`` in it.
    results : output folder of its run.

    Raises
    ------
    InputError
        If there is no truth.
    """
    truth = project / TRUTH
    if not truth.is_dir():
        raise InputError(
            "There is no truth beside the project.",
            "Compare the results of a project that `aerocal simulate` wrote.",
            file=truth,
        )
    orientations = _joined(truth, results, "exterior_orientations", ["image"])
    points = _joined(truth, results, "object_points", ["point"])
    angles = ("omega_deg", "phi_deg", "kappa_deg")
    kinds = (
        _kind("positions", "m", orientations, ("x_m", "y_m", "z_m")),
        _kind("attitudes", "deg", orientations, angles),
        _kind("object points", "m", points, ("x_m", "y_m", "z_m")),
    )
    return TruthComparison(_parameters(truth, results), kinds)


def _joined(truth: Path, results: Path, name: str, key: list[str]) -> pd.DataFrame:
    """Rows of both tables with the same key; true columns end in ``_true``."""
    estimated = pq.read_table(results / f"{name}.parquet").to_pandas()
    true = pq.read_table(truth / f"{name}.parquet").to_pandas()
    both: pd.DataFrame = estimated.merge(true, on=key, suffixes=("", "_true"), validate="one_to_one")
    return both


def _kind(kind: str, unit: str, table: pd.DataFrame, columns: tuple[str, ...]) -> RecoveredKind:
    error: Floats = np.stack([(table[c] - table[f"{c}_true"]).to_numpy(np.float64) for c in columns])
    if unit == "deg":
        error = (error + 180.0) % 360.0 - 180.0
    sigma: Floats = np.stack([table[f"sigma_{c}"].to_numpy(np.float64) for c in columns])
    return RecoveredKind(
        kind,
        unit,
        error.size,
        _root_mean_square(error),
        _root_mean_square(sigma),
        _root_mean_square(error / sigma),
    )


def _root_mean_square(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _parameters(truth: Path, results: Path) -> tuple[RecoveredParameter, ...]:
    """The estimated parameters whose truth is known."""
    table = _joined(truth, results, "parameters", ["parameter", "entity", "unit"])
    return tuple(
        RecoveredParameter(
            str(row["parameter"]),
            str(row["entity"]),
            str(row["unit"]),
            float(row["value_true"]),
            float(row["value"]),
            float(row["sigma"]),
        )
        for row in table[table["sigma"].notna()].to_dict("records")
    )
