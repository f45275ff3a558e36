"""The adjustment in figures for summary.json and in sentences."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.observations.image_point import ImagePoints
from adjust.quality.detectability import UNCONTROLLED
from adjust.quality.global_test import GlobalTest
from adjust.result import AdjustmentResult, GroupResult, ObservationStatus
from adjust.selection.correlation import correlation_matrix
from tasks.evaluation.free_network_figures import free_network_figures, free_network_sentences
from tasks.evaluation.remark_words import (
    global_test_words,
    misfit_words,
    rejected_control_words,
    some_names,
)
from tasks.evaluation.result_tables import AdjustedBlock
from tasks.evaluation.surveyed_differences import (
    left_out_figures,
    rejected_control,
    surveyed_differences,
)
from tasks.evaluation.variance_figures import (
    correlation_figures,
    correlation_sentences,
    variance_figures,
    variance_sentences,
)
from tasks.evaluation.weak_modes import weak_mode_sentences
from tasks.files.json_text import JSON
from tasks.quantities import group_words
from tasks.results.figures import DatumFigure, GlobalTestFigure, GroupFigure
from tasks.settings.adjustment import AdjustmentSettings

# Fewer rejected observations are gross errors, whatever part of their group they are.
_SEVERAL = 3


def adjustment_figures(
    adjusted: AdjustedBlock, settings: AdjustmentSettings, parameters: pd.DataFrame
) -> dict[str, JSON]:
    """Figures of summary.json that the adjustment knows."""
    result = adjusted.result
    rays = result.groups[0]
    sigma_image = float(np.median(rays.sigma))
    pixel = adjusted.block.cameras[0].pixel_size
    control, check = (surveyed_differences(adjusted, is_check) for is_check in (False, True))
    control = control[control["status"] == "used"]
    test = result.test
    return {
        "sigma0": test.sigma0,
        "sigma0_um": test.sigma0 * sigma_image * 1e6,
        "sigma0_px": test.sigma0 * sigma_image / pixel,
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
        "sigma_scaled_by": adjusted.sigma0,
        "global_test": _global_test(test).to_json(),
        "groups": [_group_figure(group).to_json() for group in result.groups],
        "variance_components": variance_figures(result),
        "correlation_times": correlation_figures(result, settings.correlation_times_s),
        "datum": [
            DatumFigure(direction=share.direction, sigma=share.sigma, held_by=dict(share.shares)).to_json()
            for share in result.datum
        ],
        "free_network": free_network_figures(result),
        "frame": adjusted.map_frame.description,
    }


def _global_test(test: GlobalTest) -> GlobalTestFigure:
    return GlobalTestFigure(
        lower=test.lower, upper=test.upper, confidence=test.confidence, passed=test.passed
    )


def _group_figure(group: GroupResult) -> GroupFigure:
    return GroupFigure(
        group=group.group.name,
        observations=int(np.isfinite(group.redundancy).sum()),
        redundancy=group.redundancy_sum,
        sigma0=group.sigma0,
        rejected=group.rejected,
        uncontrolled=uncontrolled(group),
    )


def uncontrolled(group: GroupResult) -> int:
    """Number of components whose redundancy number is too small to test them."""
    return int((group.status == ObservationStatus.UNCONTROLLED).sum())


def _image_rms_px(adjusted: AdjustedBlock) -> list[JSON]:
    """RMS of the residuals of the image points that were used, in pixels, x and y."""
    group = adjusted.result.groups[0]
    assert isinstance(group.group, ImagePoints)  # the first group of every result
    cameras = adjusted.block.cameras
    pixel = np.array([camera.pixel_size for camera in cameras])[adjusted.block.camera_of_image]
    used = np.isin(group.status, (ObservationStatus.USED, ObservationStatus.UNCONTROLLED)).all(axis=1)
    residual = group.residual[used] / pixel[group.group.image[used]][:, None]
    return [float(value) for value in np.sqrt(np.mean(residual**2, axis=0))]


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


def adjustment_problems(adjusted: AdjustedBlock, settings: AdjustmentSettings) -> tuple[str, ...]:
    """What the user should know about the result, most serious first."""
    result = adjusted.result
    problems = free_network_sentences(result)
    test = result.test
    if test.redundancy <= 0:
        problems.append("The block has no redundancy: no observation is checked by others.")
    elif not test.passed:
        problems.append(global_test_words(test.sigma0, _global_test(test)))
    problems += _mostly_rejected(result)
    problems += [words for group in result.groups if (words := misfit_words(_group_figure(group)))]
    problems += variance_sentences(result)
    problems += correlation_sentences(result, settings.correlation_times_s)
    problems += _correlated(adjusted) + _rejected(adjusted, settings) + _uncontrolled(adjusted)
    return tuple(problems)


def _correlated(adjusted: AdjustedBlock) -> list[str]:
    """Sentences about the system parameters that the block separates least."""
    parameters = adjusted.result.layout.border_quantities
    return weak_mode_sentences(parameters, correlation_matrix(adjusted.cofactor.reduced.corner))


def _mostly_rejected(result: AdjustmentResult) -> list[str]:
    """Groups of which most was rejected: that is one error of all, and no gross error of each."""
    sentences = []
    for group in result.groups:
        count = int(group.group.stochastic.taking_part.sum())
        part = int((group.status == ObservationStatus.REJECTED).any(axis=1).sum())
        if count and part >= _SEVERAL and part > 0.5 * count:
            words = group_words(group.group.name)
            sentences.append(
                f"{part:,} of {count:,} {words} were rejected, so they hardly contribute to the result. So "
                "many must have a common cause, such as their datum, height system, lever arm or σ."
            )
    return sentences


def _rejected(adjusted: AdjustedBlock, settings: AdjustmentSettings) -> list[str]:
    result = adjusted.result
    if settings.rejection.critical_value is None:
        return []
    counts = [
        f"{group.rejected:,} {group_words(group.group.name)}" for group in result.groups if group.rejected
    ]
    if not counts:
        return []
    back = f"; {result.taken_back:,} that had been rejected were accepted again" if result.taken_back else ""
    sentences = [
        f"Rejected as gross errors: {', '.join(counts)} (|standardized residual| above "
        f"{settings.rejection.critical_value:g}){back}."
    ]
    if rejected := rejected_control(adjusted):
        sentences.append(rejected_control_words(rejected))
    if len(result.given_up):
        names = [adjusted.block.points[point] for point in result.given_up]
        sentences.append(
            f"{len(names):,} object points were removed, because the wrong one of their image points cannot "
            f"be identified: {some_names(names)}."
        )
    return sentences


def _uncontrolled(adjusted: AdjustedBlock) -> list[str]:
    count = uncontrolled(adjusted.result.groups[0])
    if count == 0:
        return []
    return [
        f"{count:,} image coordinates are uncontrolled (redundancy number below {UNCONTROLLED:g}, such as "
        "points with two rays along the base): a gross error in them would not be detected. They were not "
        "tested."
    ]
