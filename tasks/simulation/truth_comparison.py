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
from scipy import special

from adjust.arrays import Floats
from tasks.errors import Location
from tasks.quantities import is_calibrated
from tasks.simulation.simulation_truth import TRUTH
from tasks.tables.covariance import Key, correlation_pairs, covariance_of, sigmas_of

# A single block is one draw: its unknowns are correlated, so the pooled ratio scatters about 1.
_POOLED_LIMITS = (0.8, 1.2)
# A focal length that is estimated moves all projection centres together, in proportion to their height: then
# their ratio is little more than one draw of its own error, which is tested by itself.
_POOLED_LIMITS_OF_POSITIONS = (0.3, 3.0)
# Exceeded once in 16,000 parameters.
_LARGEST_T = 4.0
_SMALLEST_PROBABILITY = 6e-5
POSITIONS = "positions"


@dataclass(frozen=True)
class RecoveredParameter:
    """A system parameter next to its truth, in the unit of parameters.parquet."""

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
    """All unknowns of one kind next to their truth.

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
class JointTest:
    """All errors of the parameters together: eᵀ C⁻¹ e with their covariance matrix.

    Attributes
    ----------
    freedom : number of parameters.
    limit : exceeded by chance once in a hundred.
    probability : of a value as large by chance.
    """

    chi_squared: float
    freedom: int
    limit: float
    probability: float


@dataclass(frozen=True)
class TruthComparison:
    """Comparison of an adjustment with the known truth of its block.

    Attributes
    ----------
    parameters : of the cameras and flights.
    kinds : many unknowns of one kind; the biases and drifts of the strips are among them.
    joint : of the parameters; None without any.
    """

    parameters: tuple[RecoveredParameter, ...]
    kinds: tuple[RecoveredKind, ...]
    joint: JointTest | None = None

    def contradictions(self) -> tuple[str, ...]:
        """Sentences about estimates that do not agree with the truth within their standard deviations."""
        found = [
            f"{item.parameter} of {item.entity} is wrong by {item.t:+z.1f} of its standard deviation."
            for item in self.parameters
            if not abs(item.t) <= _LARGEST_T
        ]
        if self.joint is not None and self.joint.probability < _SMALLEST_PROBABILITY:
            found.append(
                f"The {self.joint.freedom} parameters together are wrong: χ² {self.joint.chi_squared:.1f}."
            )
        found += [
            f"The errors of the {item.kind} are {item.pooled:.2f} times their standard deviations; "
            f"{low:g} to {high:g} is expected."
            for item in self.kinds
            for low, high in (self._limits(item.kind),)
            if not low <= item.pooled <= high
        ]
        return tuple(found)

    def agreement(self) -> str:
        """A sentence on what was tested, for a result without contradictions."""
        tested = []
        if self.parameters:
            largest = max(abs(item.t) for item in self.parameters)
            tested.append(f"the largest error of a parameter is {largest:.1f} σ ({_LARGEST_T:g} σ allowed)")
        if self.kinds:
            ratios = (
                f"{item.kind} {item.pooled:.2f} ({low:g} to {high:g})"
                for item in self.kinds
                for low, high in (self._limits(item.kind),)
            )
            tested.append(f"RMS of error/σ with its limits: {', '.join(ratios)}")
        return f"The result agrees with the truth: {'; '.join(tested) or 'nothing is estimated'}."

    def _limits(self, kind: str) -> tuple[float, float]:
        """Smallest and largest pooled ratio of a kind that are expected by chance."""
        common = any(item.parameter == "focal_length" for item in self.parameters)
        return _POOLED_LIMITS_OF_POSITIONS if kind == POSITIONS and common else _POOLED_LIMITS


def compare_with_truth(project: Path, results: Path) -> TruthComparison:
    """Compare the published results of a simulated project with the truth next to it.

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
        raise Location(truth).error(
            "There are no true values with the project.",
            "Compare the results of a project that `aerocal simulate` wrote.",
        )
    orientations = _joined(truth, results, "exterior_orientations", ["image"])
    points = _joined(truth, results, "object_points", ["point"])
    angles = ("omega_deg", "phi_deg", "kappa_deg")
    kinds = (
        _kind(POSITIONS, "m", orientations, ("x_m", "y_m", "z_m")),
        _kind("attitudes", "deg", orientations, angles),
        _kind("object points", "m", points, ("x_m", "y_m", "z_m")),
    )
    estimated, of_strips = _parameters(truth, results)
    return TruthComparison(estimated, (*kinds, *_of_strips(of_strips)), _joint(results, estimated))


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


def _parameters(
    truth: Path, results: Path
) -> tuple[tuple[RecoveredParameter, ...], tuple[RecoveredParameter, ...]]:
    """The estimated parameters whose truth is known: those of cameras and flights, and those of strips."""
    table = _joined(truth, results, "parameters", ["parameter", "entity", "unit"])
    found = [
        RecoveredParameter(
            str(row["parameter"]),
            str(row["entity"]),
            str(row["unit"]),
            float(row["value_true"]),
            float(row["value"]),
            float(row["sigma"]),
        )
        for row in table[table["sigma"].notna()].to_dict("records")
    ]
    kept = tuple(item for item in found if is_calibrated(item.parameter))
    return kept, tuple(item for item in found if not is_calibrated(item.parameter))


def _of_strips(found: tuple[RecoveredParameter, ...]) -> tuple[RecoveredKind, ...]:
    """The biases and drifts of the strips, by their unit."""
    kinds = []
    for unit in dict.fromkeys(item.unit for item in found):
        own = [item for item in found if item.unit == unit]
        error: Floats = np.array([item.estimated - item.true for item in own])
        sigma: Floats = np.array([item.sigma for item in own])
        numbers = (_root_mean_square(error), _root_mean_square(sigma), _root_mean_square(error / sigma))
        kinds.append(
            RecoveredKind(
                "strips' drifts" if unit.endswith("/s") else "strips' biases", unit, len(own), *numbers
            )
        )
    return tuple(kinds)


def _joint(results: Path, found: tuple[RecoveredParameter, ...]) -> JointTest | None:
    """The test of all parameters together."""
    if not found:
        return None
    tables = [
        pq.read_table(results / f"{name}.parquet").to_pandas() for name in ("parameters", "correlations")
    ]
    keys: list[Key] = [(item.parameter, item.entity) for item in found]
    error: Floats = np.array([item.estimated - item.true for item in found])
    covariance = covariance_of(keys, sigmas_of(tables[0]), correlation_pairs(tables[1]))
    chi_squared = float(error @ np.linalg.solve(covariance, error))
    freedom = len(found)
    return JointTest(
        chi_squared,
        freedom,
        float(special.chdtri(freedom, 0.01)),
        float(special.chdtrc(freedom, chi_squared)),
    )
