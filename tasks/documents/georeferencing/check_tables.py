"""The tables of the page of a check."""

from __future__ import annotations

import numpy as np

from tasks.document_kit.row_table import number_of, omitted, table_of, text_of
from tasks.document_kit.table import (
    Column,
    Row,
    Table,
    components,
    decimals_for,
    numbers,
    text_column,
)
from tasks.documents.georeferencing.check_figures import DifferenceFigures, Triple
from tasks.documents.georeferencing.material import CheckMaterial
from tasks.documents.report.surveyed_differences import HEADINGS, with_ratios
from tasks.documents.report.surveyed_points import DIFFERENCES, POINT
from tasks.georeferencing.difference_statistics import CONFIDENCE, PARTS
from tasks.georeferencing.point_differences import INDEPENDENT
from tasks.quantities import quantity_words

_AXES = ("x", "y", "z")
_PERCENT = f"{100 * CONFIDENCE:g} %"
MOST_ROWS = 50

# Figure, words, decimals, whether a positive number shows its sign.
_FIGURES = (
    ("points", "points", 0, False),
    ("rmse_m", "RMS, not centred [m]", 3, False),
    ("predicted_rmse_m", "predicted RMS [m]", 3, False),
    ("predicted_low_m", f"from ({_PERCENT}) [m]", 3, False),
    ("predicted_high_m", f"to ({_PERCENT}) [m]", 3, False),
    ("degrees_of_freedom", "its degrees of freedom", 1, False),
    ("mean_m", "mean [m]", 3, True),
    ("predicted_mean_sigma_m", "predicted σ of the mean [m]", 3, False),
    ("sd_m", "standard deviation about the mean [m]", 3, False),
    ("max_m", "largest |d| [m]", 3, False),
    ("rmse_gsd", "RMS [GSD]", 2, False),
    ("max_gsd", "largest |d| [GSD]", 2, False),
)
_PART_WORDS = {
    "image_points": "image points",
    "gnss_ins": "GNSS and INS of single images",
    "strips": "GNSS and INS, common to a strip",
    "calibration": "calibration, common to all images",
    "survey": "survey of the points",
    "shared": "also used in the calibration (−: reduces)",
}


def difference_tables(material: CheckMaterial) -> tuple[Table, ...]:
    """Figures at the independent points, at the control of the calibration, and in the models."""
    figures = material.figures
    return (
        _difference_table("independent", "Independent check points, all rays", figures),
        _difference_table(
            "models", "Independent check points, two rays of a stereo model", figures.in_models
        ),
        _difference_table(
            "control",
            "Control points (not independent)",
            figures.at_control_of_calibration,
        ),
    )


def _difference_table(name: str, caption: str, figures: DifferenceFigures) -> Table:
    columns = (text_column("figure", "figure"), *components("{}", HEADINGS, "", _AXES))
    rows = []
    for key, words, decimals, plus in _FIGURES:
        values: Triple = getattr(figures, key)
        if any(value is not None for value in values):
            rows.append(Row(key, (words, *numbers(values, decimals, plus=plus))))
    return Table(name, caption, columns, tuple(rows) if figures.count else ())


def source_table(material: CheckMaterial) -> Table:
    """The effect of each kind of error alone, at the independent points and in their models."""
    columns = (
        text_column("source", "source"),
        *components("{}_m", [f"all rays, {h}" for h in HEADINGS], "m", _AXES),
        *components("model_{}_m", [f"in models, {h}" for h in HEADINGS], "m", _AXES),
    )
    none: Triple = (None, None, None)
    figures, models = material.figures, material.figures.in_models
    rows = [
        Row(
            part,
            (
                _PART_WORDS[part],
                *numbers(figures.predicted_parts_m.get(part, none), 3),
                *numbers(models.predicted_parts_m.get(part, none), 3),
            ),
        )
        for part in PARTS
    ]
    together = (*numbers(figures.predicted_rmse_m, 3), *numbers(models.predicted_rmse_m, 3))
    rows.append(Row("all", ("all together", *together)))
    return Table(
        "sources", "Error budget of the predicted RMS", columns, tuple(rows) if figures.count else ()
    )


def point_table(material: CheckMaterial) -> Table:
    """One row for each surveyed point, the largest |d|/σ first."""
    table = with_ratios(material.points, material.points["gsd_m"].to_numpy(np.float64), is_check=True)
    table = table.sort_values("largest", ascending=False, kind="stable")
    listed = table.head(MOST_ROWS)
    shown = (
        POINT,
        text_of("status", "was", lambda row: "check" if row["status"] == INDEPENDENT else "control"),
        *DIFFERENCES,
    )
    note = omitted(listed, table, "direct_georeferencing.parquet", largest=True)
    return table_of("points", "Surveyed points, the largest |d|/σ first", shown, listed, "{point}", note)


def statement_table(material: CheckMaterial) -> Table:
    """The statements according to the standards."""
    shown = (
        text_of("standard", "standard"),
        text_of("edition", "edition"),
        number_of("check_points", "check points"),
        number_of("needed", "needed", of="check_points_needed"),
        text_of("sentence", "statement"),
    )
    caption = "Statements according to published standards"
    return table_of("statements", caption, shown, material.figures.statements, "{standard}")


def parallax_table(material: CheckMaterial) -> Table:
    """Figures of the y-parallaxes next to their prediction."""
    f = material.figures
    columns = (
        text_column("figure", "figure"),
        Column("found", "found", "µm"),
        Column("predicted", "predicted", "µm"),
        Column("low", f"from ({_PERCENT})", "µm"),
        Column("high", f"to ({_PERCENT})", "µm"),
    )
    low, high = f.y_parallax_predicted_low_um, f.y_parallax_predicted_high_um
    rows = (
        ("rms", "RMS", (f.y_parallax_rms_um, f.y_parallax_predicted_rms_um, low, high)),
        (
            "max",
            "largest",
            (
                f.y_parallax_max_um,
                f.y_parallax_predicted_max_um,
                None,
                f.y_parallax_predicted_max_limit_um,
            ),
        ),
        (
            "remaining",
            "σ after relative orientation of each model: image coordinates only",
            (f.y_parallax_remaining_sigma_um, f.y_parallax_image_sigma_um, None, None),
        ),
    )
    made = tuple(Row(key, (words, *numbers(values, 2))) for key, words, values in rows)
    return Table("parallaxes", "y-parallaxes of all models", columns, made if f.y_parallaxes else ())


def model_table(material: CheckMaterial) -> Table:
    """The models with the largest RMS."""
    models = material.models[material.models["points"] > 0]
    models = models.sort_values("rms_um", ascending=False, kind="stable")
    listed = models.head(20)
    shown = (
        text_of("model", "model", lambda row: f"{row['left']} – {row['right']}"),
        text_of("strip", "strip"),
        number_of("points", "points"),
        number_of("mismatches", "mismatches"),
        number_of("base_m", "base", "m"),
        number_of("rms_um", "RMS", "µm", 1),
        number_of("predicted_rms_um", "predicted RMS", "µm", 1),
        number_of("max_um", "largest", "µm", 1),
        number_of("remaining_rms_um", "RMS after relative orientation", "µm", 2),
    )
    note = omitted(listed, models, "stereo_models.parquet")
    caption = "Models with the largest y-parallaxes"
    return table_of("model-parallaxes", caption, shown, listed, "{left}|{right}", note)


def calibration_table(material: CheckMaterial) -> Table:
    """The calibration that was applied."""
    shown = (
        text_of("parameter", "parameter", lambda item: quantity_words(item.parameter)),
        text_of("entity", "of"),
        number_of("value", "value", decimals=lambda item: decimals_for(item.sigma) or 6),
        number_of("sigma", "σ", decimals="sigma"),
        text_of("unit", "unit"),
    )
    applied = material.figures.calibration
    return table_of("calibration", "Applied calibration", shown, applied, "{parameter}@{entity}")
