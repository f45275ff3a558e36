"""Tables of model alternatives: what was tested, and what each would do to the calibration."""

from __future__ import annotations

from tasks.tables.schemas.columns import TableSchema, count, number, text

MODEL_ALTERNATIVES = TableSchema(
    "model_alternatives",
    "A possible deficiency of the adjustment model, tested without a new adjustment.",
    (
        text("quantity", "what differs: a parameter, or an effect that no parameter describes"),
        text("entity", "camera or flight it belongs to; empty: the whole block"),
        text(
            "scope", "type of the part; all: every exposure",
            values=("all", "flight", "height", "direction", "strip"),
        ),
        text("part", "flight, height, direction or strip in which it differs; empty: every exposure"),
        text("unit", "unit of the estimate"),
        number("estimate", "size if alone in the model; null if not determinable", "see unit", nullable=True),
        number("sigma", "its standard deviation", "see unit", nullable=True),
        number("t", "estimate divided by its standard deviation", nullable=True),
        number("detectable", "size that is detected with a probability of 80 %", "see unit", nullable=True),
        count("rank", "rank among those that explain the misclosures together; 0: not among them"),
        number("explained", "size together with those; null if not among them", "see unit", nullable=True),
        number("explained_sigma", "its standard deviation; null likewise", "see unit", nullable=True),
        text("alike", "other alternatives with nearly the same effect; null: none", nullable=True),
        text("moves", "calibrated parameter most affected if undetected; null: none", nullable=True),
        text("moves_entity", "camera or flight of that parameter", nullable=True),
        number("moved_by_detectable", "its change by the smallest detectable, in sigma", nullable=True),
        number("moved_by_estimate", "its change by the estimate, in sigma", nullable=True),
    ),
    ("quantity", "entity", "scope", "part"),
)  # fmt: skip

MODEL_ALTERNATIVE_EFFECTS = TableSchema(
    "model_alternative_effects",
    "Effect on a parameter of an alternative that is not in the model.",
    (
        text("quantity", "see model_alternatives"),
        text("entity", "see model_alternatives"),
        text("scope", "see model_alternatives"),
        text("part", "see model_alternatives"),
        text("unit", "unit of the alternative"),
        text("parameter", "name of the affected parameter"),
        text("parameter_entity", "camera, flight or strip it belongs to"),
        number("effect", "change of the parameter for one unit of the alternative, in their units", "units"),
    ),
    ("quantity", "entity", "scope", "part", "parameter", "parameter_entity"),
)
