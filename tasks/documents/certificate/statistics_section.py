"""Section of the adjustment's statistics, following the protocols of burn-in triangulations.

RMS of control and largest ground residuals, of photo positions and attitudes (the residuals of GNSS and INS),
mean standard deviations of object points and orientations, and the limits set for them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from adjust.parameters import GNSS_STRIP_BIAS
from tasks.document_kit.table import Cell, Column, Number, Row, Table, numbers, text_column
from tasks.documents.certificate.content import Block, Fact, Facts, Listing, Section
from tasks.documents.report.key_figures import relative_um
from tasks.documents.report.material import TOOK_PART, Material
from tasks.quantities import group_words, unit_words
from tasks.settings.quality import AxisGate

_XYZ = ("x", "y", "z")
#: Units of residuals as they are shown, and decimals.
_STRIP_PRIORS = f"prior:{GNSS_STRIP_BIAS}"
_DECIMALS = {"um": 2, "m": 3, "deg": 4}
_BODY = ("roll", "pitch", "yaw")


def statistics_section(results: Material) -> Section:
    """σ0, degrees of freedom, and the table of RMS and mean σ."""
    blocks: list[Block] = [Facts("adjustment", "", facts_of(results)), Listing(statistics_table(results))]
    blocks.append(Listing(group_table(results), ("group",)))
    return Section("statistics", "Statistics of the adjustment", tuple(blocks))


def facts_of(results: Material) -> tuple[Fact, ...]:
    """σ0, degrees of freedom and counts of an adjustment."""
    summary, counts, test = results.summary, results.summary.counts, results.figures.global_test
    rms = results.figures.image_rms_px or (None, None)
    facts = [
        Fact("sigma0", "σ0, a posteriori / a priori", (Number(summary.sigma0, 3),)),
        Fact("sigma0_um", "σ0 of an image coordinate", (Number(summary.sigma0_um, 3),), "µm"),
        Fact(
            "sigma_relative_um",
            "σ relative: of the image points only",
            (Number(relative_um(results), 3),),
            "µm",
        ),
        Fact("sigma_absolute_um", "σ absolute: of all observations", (Number(summary.sigma0_um, 3),), "µm"),
        Fact("sigma0_px", "in pixels", (Number(summary.sigma0_px, 3),), "px"),
        Fact("image_rms_px", "RMS of the image residuals x, y", numbers(rms, 3), "px"),
        Fact("redundancy", "degrees of freedom", (Number(summary.redundancy),)),
        Fact("iterations", "iterations", (Number(summary.iterations),)),
        Fact("images", "images", (Number(counts.images),)),
        Fact("object_points", "object points", (Number(counts.object_points),)),
        Fact("image_points", "image points used", (Number(counts.image_points),)),
        Fact("rejected", "rejected observations", (Number(counts.rejected),)),
        Fact("control", "control points", (Number(counts.control),)),
        Fact("check", "check points", (Number(counts.check),)),
    ]
    if test is not None and test.lower is not None and test.upper is not None:
        limits = numbers((test.lower, test.upper), 3)
        words = f"global test of σ0, {100 * test.confidence:g} %"
        facts.append(Fact("global_test", words, ("passed" if test.passed else "failed",)))
        facts.append(Fact("global_test_limits", "σ0 allowed from, to", limits))
    return tuple(facts)


def statistics_table(results: Material) -> Table:
    """The table of the protocol; X, Y, Z of attitudes are roll, pitch, yaw (RMS) and ω, φ, κ (σ)."""
    control = results.control_residuals
    ground = _components(control[control["status"] == "used"], [f"d{axis}_m" for axis in _XYZ])
    gates = results.project.gates
    orientations = results.images[results.images["sigma_x_m"].notna()]
    check = _components(results.check_points, [f"d{axis}_m" for axis in _XYZ])
    of_check = (
        _row("rms_check_m", "RMS check points", "m", _rms(check), 3),
        _limit("rms_check_limit_m", gates.rmse_check_m, _rms(check)),
        _row("largest_check_m", "largest difference at check points", "m", _largest(check), 3),
        _limit("largest_check_limit_m", gates.max_check_m, _largest(check)),
    )
    rows = [
        _row("rms_control_m", "RMS control", "m", _rms(ground), 3),
        _limit("rms_control_limit_m", gates.rmse_control_m, _rms(ground)),
        _row("largest_ground_residual_m", "largest ground residual", "m", _largest(ground), 3),
        _limit("largest_ground_residual_limit_m", gates.max_control_m, _largest(ground)),
        *(of_check if any(len(values) for values in check) else ()),
        _row(
            "mean_sigma_object_points_m",
            "mean σ of object points",
            "m",
            _mean(results.object_points, "sigma_{}_m", _XYZ),
            3,
        ),
        _row(
            "rms_photo_position_m", "RMS photo position", "m", _of_group(results, "gnss_positions", _XYZ), 3
        ),
        _row(
            "rms_photo_attitude_deg",
            "RMS photo attitude (roll, pitch, yaw)",
            "°",
            _of_group(results, "ins_attitudes", _BODY),
            4,
        ),
        _row(
            "mean_sigma_photo_position_m",
            "mean σ of photo position",
            "m",
            _mean(orientations, "sigma_{}_m", _XYZ),
            3,
        ),
        _row(
            "mean_sigma_photo_attitude_deg",
            "mean σ of photo attitude (ω, φ, κ)",
            "°",
            _mean(orientations, "sigma_{}_deg", ("omega", "phi", "kappa")),
            4,
        ),
    ]
    columns = (
        text_column("figure", ""),
        text_column("unit", "unit"),
        Column("x", "X / ω"),
        Column("y", "Y / φ"),
        Column("z", "Z / κ"),
        Column("xy", "XY"),
        text_column("kept", "limit is"),
    )
    note = (
        "Photo positions and attitudes: residuals of GNSS and INS after boresight, lever arm, shift and "
        "strip biases. XY = √½(X² + Y²). Limits are those of the project."
    )
    return Table("statistics", "Statistics in the form of a burn-in protocol", columns, tuple(rows), note)


def _row(key: str, words: str, unit: str, values: Sequence[float | None], decimals: int) -> Row:
    x, y, z = values
    plan = None
    if unit == "m" and key.startswith("rms") and x is not None and y is not None:
        plan = float(np.sqrt(0.5 * (x**2 + y**2)))
    cells: tuple[Cell, ...] = (words, unit, *numbers((x, y, z, plan), decimals), "")
    return Row(key, cells)


def _limit(key: str, gate: AxisGate | None, values: Sequence[float | None]) -> Row:
    """The limit of the row above; a missing figure does not meet it."""
    if gate is None:
        return Row(key, ("   limit", "", "", "", "", "", "none set"))
    kept = all(v is not None and v <= limit for v, limit in zip(values, gate.max, strict=True))
    return Row(key, ("   limit", "m", *numbers(gate.max, 3), "", "met" if kept else "not met"))


def _components(table: pd.DataFrame, names: Sequence[str]) -> list[np.ndarray]:
    return [table[name].dropna().to_numpy(np.float64) for name in names]


def _rms(values: Sequence[np.ndarray]) -> tuple[float | None, ...]:
    return tuple(float(np.sqrt(np.mean(v**2))) if len(v) else None for v in values)


def _largest(values: Sequence[np.ndarray]) -> tuple[float | None, ...]:
    return tuple(float(np.max(np.abs(v))) if len(v) else None for v in values)


def _mean(table: pd.DataFrame, pattern: str, names: Sequence[str]) -> tuple[float | None, ...]:
    columns = _components(table, [pattern.format(name) for name in names])
    return tuple(float(np.mean(v)) if len(v) else None for v in columns)


def _of_group(results: Material, group: str, components: Sequence[str]) -> tuple[float | None, ...]:
    """RMS residual of each component of an observation group, of the observations used."""
    table = results.residuals
    own = table[(table["group"] == group) & table["status"].isin(TOOK_PART)]
    return _rms([own.loc[own["component"] == c, "residual"].to_numpy(np.float64) for c in components])


def _largest_residuals(results: Material, group: str) -> tuple[Cell, ...]:
    """Largest residual with its unit, and largest standardized one; units are not mixed."""
    table = results.residuals
    own = table[(table["group"] == group) & table["status"].isin(TOOK_PART)]
    units = own["unit"].unique()
    standardized = own["standardized"].abs().max() if len(own) else None
    if len(units) != 1:
        return Number(None), "", Number(standardized, 1)
    largest = float(own["residual"].abs().max())
    shown, decimals = unit_words(str(units[0])), _DECIMALS.get(str(units[0]), 3)
    return Number(largest, decimals), shown, Number(standardized, 1)


def group_table(results: Material) -> Table:
    """The observation groups; priors of single strips together would fill a page and are left out."""
    columns = (
        text_column("group", "observation group"),
        Column("observations", "observations"),
        Column("redundancy", "redundancy"),
        Column("sigma0", "σ0 of the group"),
        Column("rejected", "rejected"),
        Column("largest", "largest residual"),
        text_column("unit", "unit"),
        Column("largest_standardized", "largest standardized residual"),
        Column("critical_value", "critical value"),
    )
    shown = [group for group in results.figures.groups if group.group != _STRIP_PRIORS]
    rows = tuple(
        Row(
            group.group,
            (
                group_words(group.group),
                Number(group.observations),
                Number(group.redundancy, 1),
                Number(group.sigma0, 3),
                Number(group.rejected),
                *_largest_residuals(results, group.group),
                Number(results.figures.critical_value, 2),
            ),
        )
        for group in shown
    )
    note = (
        "Observations are single coordinates and angles that were used; rejected are points, positions and "
        "attitudes. Largest residuals of the observations used. An observation beyond the critical value is "
        "rejected; where all its components are tested together, a single one may exceed it."
    )
    if len(shown) < len(results.figures.groups):
        note += " Priors of the strip biases are not listed."
    return Table("groups", "Observation groups", columns, rows, note)
