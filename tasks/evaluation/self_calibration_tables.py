"""What became of the additional parameters: self_calibration.parquet and figures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.arrays import Floats, Ints
from adjust.camera.additional.register import REGISTER
from adjust.camera.additional.selection import selected_items
from adjust.parameters import ADDITIONAL_PARAMETERS, Quantity, SystemParameters
from adjust.quality.considered import with_considered
from adjust.selection.correlation import correlation_matrix, total_correlation
from adjust.selection.elimination import Criterion, Decision
from adjust.selection.parameter_selection import SelectedAdjustment
from adjust.selection.significance import difference_test, group_test, t_values
from tasks.block.self_calibration import BlockSelfCalibration
from tasks.evaluation.parameter_tables import columns_of
from tasks.results.figures import DecisionFigure, FlightTestFigure, GroupTestFigure, SelfCalibrationFigures
from tasks.settings.adjustment import AdjustmentSettings
from tasks.tables.parquet import of_schema, write_stage_table
from tasks.tables.schemas.parameters import SELF_CALIBRATION

# α of the tests of whole groups of parameters and of the difference between flights.
_ERROR_PROBABILITY = 0.01


def write_self_calibration(
    folder: Path, selection: SelectedAdjustment, calibration: BlockSelfCalibration, sigma0: float
) -> pd.DataFrame:
    """self_calibration.parquet: every additional parameter that was offered; returns it."""
    table = self_calibration_table(selection, calibration, sigma0)
    write_stage_table(folder, SELF_CALIBRATION, of_schema(table, SELF_CALIBRATION))
    return table


def self_calibration_table(
    selection: SelectedAdjustment, calibration: BlockSelfCalibration, sigma0: float
) -> pd.DataFrame:
    """One row for each additional parameter that was offered, in the order of the table's key."""
    offered = selection.offered.columns[ADDITIONAL_PARAMETERS]
    first = _AllTogether.of(selection)
    steps = _last_decisions(selection)
    result = selection.result
    final = result.layout.columns[ADDITIONAL_PARAMETERS]
    variance = np.diagonal(with_considered(result.cofactor, sigma0).reduced.corner)
    total = total_correlation(result.cofactor.reduced.corner)
    values = result.state.system[ADDITIONAL_PARAMETERS]
    rows = []
    for entity, component in np.argwhere(offered >= 0):
        column, left = int(offered[entity, component]), int(final[entity, component])
        own = calibration.of_entity[entity]
        term = own.terms[own.names.index(calibration.model.names[component])][1]
        change = float(values[entity, component] - calibration.parameters.values[entity, component])
        sigma = sigma0 * float(np.sqrt(variance[left])) if left >= 0 else np.nan
        step, decision = steps.get(column, (0, None))
        rows.append(
            {
                **columns_of(calibration.parameters.quantity(entity, component)),
                "meaning": term.meaning,
                "formula": term.status,
                "unit": term.unit,
                "value": float(values[entity, component]) if left >= 0 else np.nan,
                "sigma": sigma,
                "t": change / sigma,
                **first.row(column),
                "total_correlation": float(total[left]) if left >= 0 else np.nan,
                "effect_max_um": abs(change) * calibration.largest_effect[entity, component] * 1e6,
                "effect_rms_um": abs(change) * calibration.rms_effect[entity, component] * 1e6,
                "decision": _verdict(selection, column),
                "step": step,
                "reason": "no parameter is removed" if decision is None else decision.reason,
            }
        )
    return pd.DataFrame(rows)


@dataclass(frozen=True, eq=False)
class _AllTogether:
    """Every offered parameter in the adjustment with all of them."""

    names: tuple[Quantity, ...]
    change: Floats
    sigma: Floats
    t: Floats
    correlation: Floats

    @classmethod
    def of(cls, selection: SelectedAdjustment) -> _AllTogether:
        estimate = selection.full
        variance = np.where(estimate.free, np.diagonal(estimate.cofactor), np.nan)
        correlation = np.nan_to_num(correlation_matrix(estimate.cofactor))
        np.fill_diagonal(correlation, 0.0)
        scale = estimate.sigma0 if selection.sigma0 is None else selection.sigma0
        sigma = np.asarray(scale * np.sqrt(variance))
        names = selection.offered.border_quantities
        return cls(names, estimate.change, sigma, t_values(estimate, selection.sigma0), correlation)

    def row(self, column: int) -> dict[str, object]:
        """Columns of the table that refer to it."""
        other = int(np.argmax(np.abs(self.correlation[column])))
        known = bool(np.isfinite(self.sigma[column])) and len(self.names) > 1
        return {
            "value_of_all": float(self.change[column]) if np.isfinite(self.sigma[column]) else np.nan,
            "sigma_of_all": float(self.sigma[column]),
            "t_of_all": float(self.t[column]),
            "strongest_correlation": float(self.correlation[column, other]) if known else np.nan,
            "correlated_with": str(self.names[other]) if known else None,
            "correlated_parameter": self.names[other].name if known else None,
            "correlated_entity": self.names[other].entity if known else None,
        }


def _last_decisions(selection: SelectedAdjustment) -> dict[int, tuple[int, Decision]]:
    """The last decision about each column, with its number."""
    decisions = () if selection.elimination is None else selection.elimination.decisions
    return {decision.parameter: (number, decision) for number, decision in enumerate(decisions, start=1)}


def _verdict(selection: SelectedAdjustment, column: int) -> str:
    if selection.elimination is None:
        return "is kept"
    return selection.elimination.verdict(column)


def _is_gone(selection: SelectedAdjustment, decision: Decision) -> bool:
    return selection.elimination is not None and bool(selection.elimination.eliminated[decision.parameter])


def eliminated_parameters(table: pd.DataFrame) -> frozenset[tuple[str, str]]:
    """(parameter, entity) of the eliminated parameters, from self_calibration.parquet."""
    gone = table[table["decision"] == "is eliminated"]
    return frozenset(zip(gone["parameter"], gone["entity"], strict=True))


def self_calibration_figures(
    selection: SelectedAdjustment, table: pd.DataFrame, settings: AdjustmentSettings
) -> SelfCalibrationFigures:
    """Figures of the self-calibration for summary.json."""
    elimination = selection.elimination
    decisions = () if elimination is None else elimination.decisions
    kept = table["decision"] != "is eliminated"
    return SelfCalibrationFigures(
        parameters=settings.self_calibration.parameters,
        elimination=settings.self_calibration.elimination,
        offered=len(table),
        kept=int(kept.sum()),
        sigma0_of_all=selection.full.sigma0,
        decisions=tuple(
            DecisionFigure(parameter=item.name, action=item.action.value, reason=item.reason)
            for item in decisions
        ),
        not_determinable=tuple(
            item.name
            for item in decisions
            if item.criterion is Criterion.DETERMINABILITY and _is_gone(selection, item)
        ),
        groups=tuple(_group_tests(selection, settings.self_calibration.parameters)),
        flights=tuple(_differences_of_flights(selection)),
    )


def _group_tests(selection: SelectedAdjustment, text: str) -> Iterator[GroupTestFigure]:
    """F-tests of the parts of the selection, all parameters of one part together against zero."""
    columns = selection.offered.columns[ADDITIONAL_PARAMETERS]
    (parameters,) = _additional(selection)
    for part in selected_items(text, REGISTER):
        names = {f"{part.set.name}:{name}" for name in part.names}
        chosen = columns[:, [name in names for name in parameters.family.components]]
        members = np.zeros(selection.offered.border, dtype=bool)
        members[chosen[chosen >= 0]] = True
        if not (members & selection.full.free).any():
            continue
        test = group_test(selection.full, members, _ERROR_PROBABILITY, selection.sigma0)
        yield GroupTestFigure(
            group=part.title,
            **vars(test),
            significant=bool(test.is_significant),
        )


def _differences_of_flights(selection: SelectedAdjustment) -> Iterator[FlightTestFigure]:
    """Whether the sets of one camera in two flights differ, for every pair."""
    columns = selection.offered.columns[ADDITIONAL_PARAMETERS]
    (parameters,) = _additional(selection)
    for first in range(len(columns)):
        for second in range(first + 1, len(columns)):
            both = (columns[first] >= 0) & (columns[second] >= 0)
            one, two = (parameters.quantity(entity, 0) for entity in (first, second))
            if one.camera != two.camera or not both.any():
                continue
            pair: tuple[Ints, Ints] = (columns[first][both], columns[second][both])
            test = difference_test(selection.full, *pair, _ERROR_PROBABILITY, selection.sigma0).joint
            yield FlightTestFigure(
                first=one.entity,
                second=two.entity,
                **vars(test),
                differ=bool(test.is_significant),
            )


def _additional(selection: SelectedAdjustment) -> tuple[SystemParameters, ...]:
    return tuple(p for p in selection.offered.system if p.family.name == ADDITIONAL_PARAMETERS)
