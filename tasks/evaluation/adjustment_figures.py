"""The adjustment in figures for summary.json.

Variance components also become the σ of the control points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import islice
from math import isfinite

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.observations.control_point import ControlPoints
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.image_point import ImagePoints
from adjust.observations.ins_attitude import InsAttitudes
from adjust.parameters import Quantity
from adjust.quality.correlation_time import CorrelationTime
from adjust.quality.late_heads import unknown_carriage
from adjust.quality.variance_components import VarianceComponent
from adjust.result import AdjustmentResult, GroupResult, ObservationStatus
from adjust.rig import SYNCHRONISATION_OFFSET
from adjust.selection.correlation import correlated_groups, correlation_matrix
from tasks.block.block_input import SurveyedPoints
from tasks.evaluation.result_tables import AdjustedBlock, reported_unit_of
from tasks.evaluation.surveyed_differences import (
    left_out_figures,
    rejected_control,
    surveyed_differences,
    uncontrolled_control,
)
from tasks.files.json_text import JSON
from tasks.results.figures import (
    ComponentFigure,
    CorrelationTimeFigure,
    DatumFigure,
    FreeNetworkFigure,
    GlobalTestFigure,
    GroupFigure,
    LateHeadFigure,
    VarianceFigures,
    WeakParameters,
)
from tasks.settings.adjustment import AdjustmentSettings

# Two parameters correlated by more than this are hardly separated; it is also 1 − λ of the weakest direction.
CORRELATED = 0.98
# Part of a direction (unit length) from which a parameter is named.
_INVOLVED = 0.3
_MOST_GROUPS, _MOST_MODES = 5, 3
# A smaller part of a σ adds less than half a percent to it.
_LATE_PART = 0.1


def adjustment_figures(
    adjusted: AdjustedBlock, settings: AdjustmentSettings, parameters: pd.DataFrame
) -> dict[str, JSON]:
    """Figures of summary.json that come from the adjustment."""
    result = adjusted.result
    rays = result.groups[0]
    sigma_image = float(np.median(rays.sigma))
    sigma_px = float(np.median(rays.sigma / _pixel_of_rays(adjusted)))
    control, check = (surveyed_differences(adjusted, is_check) for is_check in (False, True))
    control = control[control["status"] == "used"]
    test = result.test
    return {
        "sigma0": test.sigma0,
        "sigma0_um": test.sigma0 * sigma_image * 1e6,
        "sigma0_px": test.sigma0 * sigma_px,
        "redundancy": test.redundancy,
        "iterations": sum(len(item) for item in result.iterations),
        "counts": {
            "images": len(adjusted.block.images),
            "object_points": int(result.active_point.sum()),
            "image_points": int((rays.status[:, 0] % 2 == 0).sum()),
            "rejected": sum(group.rejected for group in result.groups),
            "rejected_image_points": rays.rejected,
            "uncontrolled": sum(uncontrolled(group) for group in result.groups),
            "control": len(control),
            "check": len(check),
        },
        "rmse_control_m": _rmse(control),
        "max_control_m": _largest(control),
        "rmse_check_m": _rmse(check),
        "max_check_m": _largest(check),
        "leave_one_out": left_out_figures(result.left_out_singly, result, adjusted.sigma0),
        "k_fold": left_out_figures(result.left_out_by_fold, result, adjusted.sigma0),
        "parameters": [
            {str(name): value for name, value in row.items()} for row in parameters.to_dict("records")
        ],
        "image_rms_px": _image_rms_px(adjusted),
        "critical_value": settings.rejection.critical_value,
        "rejected_per_pass": list(result.rejected_per_pass),
        "taken_back": result.taken_back,
        "given_up_points": [adjusted.block.points[point] for point in result.given_up],
        "inseparable_control": [adjusted.block.points[point] for point in result.inseparable],
        "unrejected_image_points": _unrejected(result, settings.rejection.critical_value),
        "sigma_scaled_by": adjusted.sigma0,
        "rejected_control": list(rejected_control(adjusted)),
        "uncontrolled_control": list(uncontrolled_control(adjusted)),
        "global_test": GlobalTestFigure.model_validate(test, from_attributes=True).to_json(),
        "groups": [_group_figure(group).to_json() for group in result.groups],
        "variance_components": variance_figures(result),
        "correlation_times": _correlation_figures(result, settings.correlation_times_s),
        "without_effect": without_effect(result, settings),
        "datum": [
            DatumFigure(direction=share.direction, sigma=share.sigma, held_by=dict(share.shares)).to_json()
            for share in result.datum
        ],
        "free_network": _free_network(result),
        "weak_parameters": [
            item.to_json()
            for item in weak_parameters(
                result.layout.border_quantities, correlation_matrix(adjusted.cofactor.reduced.corner)
            )
        ],
        "frame": adjusted.map_frame.description,
    }


def _unrejected(result: AdjustmentResult, critical_value: float | None) -> int:
    """Image points beyond the critical value that control points which contradict each other have kept."""
    if critical_value is None or len(result.inseparable) == 0:
        return 0
    rays = result.groups[0]
    beyond = (np.abs(rays.standardized) > critical_value) & (rays.status == ObservationStatus.USED)
    return int(beyond.any(axis=1).sum())


def without_effect(result: AdjustmentResult, settings: AdjustmentSettings) -> list[JSON]:
    """Keys of settings about what this adjustment does not use."""
    observed = {group.group.name for group in result.groups}
    times = {"gnss_correlation_s": GnssPositions.name, "ins_correlation_s": InsAttitudes.name}
    found: list[JSON] = [
        key for key, group in times.items() if getattr(settings, key) is not None and group not in observed
    ]
    if settings.variance_components_by and not settings.variance_components:
        found.append("variance_components_by")
    return found


def _group_figure(group: GroupResult) -> GroupFigure:
    return GroupFigure(
        group=group.group.name,
        observations=int(np.isfinite(group.redundancy).sum()),
        redundancy=group.redundancy_sum,
        sigma0=group.sigma0,
        rejected=group.rejected,
        uncontrolled=uncontrolled(group),
        rows=int(group.group.stochastic.taking_part.sum()),
        rejected_rows=int((group.status == ObservationStatus.REJECTED).any(axis=1).sum()),
    )


def _free_network(result: AdjustmentResult) -> JSON:
    """Which directions of the datum are open, and which approximate values fix them; null if not free."""
    free = result.free_network
    if free is None:
        return None
    return FreeNetworkFigure(
        inner_constraints=free.constrained, defect=free.defect, open=tuple(map(str, free.directions))
    ).to_json()


def uncontrolled(group: GroupResult) -> int:
    """Number of components whose redundancy number is too small to test them."""
    return int((group.status == ObservationStatus.UNCONTROLLED).sum())


def _image_rms_px(adjusted: AdjustedBlock) -> list[JSON]:
    """RMS of the residuals of the image points that were used, in pixels, x and y."""
    group = adjusted.result.groups[0]
    used = np.isin(group.status, (ObservationStatus.USED, ObservationStatus.UNCONTROLLED)).all(axis=1)
    residual = (group.residual / _pixel_of_rays(adjusted))[used]
    return [float(value) for value in np.sqrt(np.mean(residual**2, axis=0))]


def _pixel_of_rays(adjusted: AdjustedBlock) -> Floats:
    """(n, 1) side of a pixel of the camera of each ray, metres."""
    rays = adjusted.result.groups[0].group
    assert isinstance(rays, ImagePoints)  # the first group of every result
    pixel = np.array([camera.pixel_size for camera in adjusted.block.cameras])
    return np.asarray(pixel[adjusted.block.camera_of_image[rays.image]][:, None])


def _rmse(table: pd.DataFrame) -> list[JSON] | None:
    """√(Σd²/n) of x, y, z, not centred; null without points."""
    return _each_axis(table, lambda d: float(np.sqrt(np.mean(d**2))))


def _largest(table: pd.DataFrame) -> list[JSON] | None:
    return _each_axis(table, lambda d: float(np.max(np.abs(d))))


def _each_axis(table: pd.DataFrame, figure) -> list[JSON] | None:  # type: ignore[no-untyped-def]
    if len(table) == 0:
        return None
    values: list[JSON] = []
    for column in ("dx_m", "dy_m", "dz_m"):
        known: Floats = table[column].dropna().to_numpy(np.float64)
        values.append(figure(known) if len(known) else None)
    return values


def weak_parameters(parameters: tuple[Quantity, ...], correlation: Floats) -> tuple[WeakParameters, ...]:
    """Groups of strongly correlated parameters, strongest first, and combinations that none of them explains.

    Parameters
    ----------
    correlation : (g, g) of the parameters.
    """
    if len(parameters) < 2:
        return ()
    groups = correlated_groups(correlation, CORRELATED)
    modes = [
        members
        for members in _modes(correlation)
        if not any(len(set(group) & set(members)) > 1 for group in groups)
    ]
    strongest = islice(groups.items(), _MOST_GROUPS)
    return (
        *(_figure([parameters[k] for k in members], value) for members, value in strongest),
        *(_figure([parameters[k] for k in members]) for members in modes),
    )


def _figure(members: list[Quantity], correlation: float | None = None) -> WeakParameters:
    return WeakParameters(
        parameters=tuple(item.name for item in members),
        entities=tuple(item.entity for item in members),
        correlation=correlation,
    )


def _modes(correlation: Floats) -> list[tuple[int, ...]]:
    """Parameters of the weakest directions of the correlation matrix, weakest direction first."""
    values, vectors = np.linalg.eigh(correlation)
    weak = [k for k in range(len(values)) if values[k] < 1.0 - CORRELATED][:_MOST_MODES]
    return [tuple(int(i) for i in np.flatnonzero(np.abs(vectors[:, k]) >= _INVOLVED)) for k in weak]


def variance_figures(result: AdjustmentResult) -> JSON:
    """A row for each part of the observations, and how often they were weighted again; null without."""
    if not result.variance_components:
        return None
    return VarianceFigures(
        rounds=result.reweighted,
        confidence=result.test.confidence,
        components=tuple(_component_row(result, component) for component in result.variance_components),
    ).to_json()


def _component_row(result: AdjustmentResult, component: VarianceComponent) -> ComponentFigure:
    """The median σ only where all components have one unit: those of known calibrations have several."""
    group = result.groups[component.part.group].group
    units = {reported_unit_of(group, number) for number in component.part.components}
    unit, factor = units.pop() if len(units) == 1 else ("", float("nan"))
    return ComponentFigure(
        part=component.part.name,
        estimated=component.estimated,
        factor=component.factor,
        factor_lower=component.lower,
        factor_upper=component.upper,
        sigma=component.sigma * factor,
        unit=unit,
        redundancy=component.redundancy,
        degrees_of_freedom=component.degrees_of_freedom,
    )


def _correlation_figures(result: AdjustmentResult, stated_s: Mapping[str, float | None]) -> JSON:
    """A row for each group whose errors are correlated over time; null without any.

    Parameters
    ----------
    stated_s : group → the correlation time of the project, s.
    """
    estimated = {item.name: item for item in result.correlation_times}
    observed = {group.group.name for group in result.groups}
    rows: list[JSON] = [
        _correlation_row(name, seconds, estimated.get(name)).to_json()
        for name, seconds in stated_s.items()
        if seconds is not None and name in observed
    ]
    return rows or None


def _correlation_row(group: str, stated_s: float, item: CorrelationTime | None) -> CorrelationTimeFigure:
    if item is None or item.verdict == "stated":
        seconds = stated_s if item is None else item.seconds
        return CorrelationTimeFigure(
            group=group,
            stated_s=stated_s,
            correlation_s=seconds,
            verdict="stated",
            tested=item is not None,
        )
    return CorrelationTimeFigure(
        group=group,
        stated_s=stated_s,
        correlation_s=item.seconds,
        lower_s=item.lower,
        upper_s=item.upper if isfinite(item.upper) else None,
        verdict=item.verdict,
        tested=True,
    )


def with_estimated_sigmas(surveyed: SurveyedPoints, result: AdjustmentResult) -> SurveyedPoints:
    """Control points with the standard deviations that the adjustment gave them; check points as stated."""
    factors = np.ones(3)
    for component in result.variance_components:
        if result.groups[component.part.group].group.name == ControlPoints.name:
            factors[list(component.part.components)] = component.factor
    of_points = np.where(surveyed.is_check[:, None], 1.0, factors)
    covariance = surveyed.covariance * of_points[:, :, None] * of_points[:, None, :]
    return replace(surveyed, covariance=covariance)


def late_head_figures(result: AdjustmentResult) -> tuple[LateHeadFigure, ...]:
    """Heads that errors of the boresight, which σ do not contain, move by more than a tenth of a σ."""
    (error, part), block = unknown_carriage(result), result.block
    found = []
    for head in np.unique(block.camera_of_image[part > _LATE_PART]):
        image = int(np.argmax(np.where(block.camera_of_image == head, part, 0.0)))
        offset = float(result.state.system[SYNCHRONISATION_OFFSET][head, 0])
        found.append(
            LateHeadFigure(
                head=block.cameras[head].name,
                offset_s=offset,
                sigma_m=float(error[image]),
                part_of_sigma=float(part[image]),
            )
        )
    return tuple(found)
