"""Tables of system and additional parameters, and of their correlations."""

from __future__ import annotations

from tasks.tables.schemas.columns import TableSchema, count, number, text

#: What has a parameter, each by itself: an entity is a text for people.
OWNER = (
    text("camera", "camera it belongs to; null: to none", nullable=True),
    text("flight", "flight it belongs to, empty for one without a name; null: to none", nullable=True),
    text("strip", "strip it belongs to; null: to none", nullable=True),
)

PARAMETERS = TableSchema(
    "parameters",
    "A system parameter.",
    (
        text("parameter", "name, e.g. boresight_roll"),
        text(
            "entity",
            "camera, flight or strip it belongs to; CAMERA in FLIGHT of a set that holds in one flight",
        ),
        *OWNER,
        number("value", "adjusted value", "see unit"),
        number("change", "adjusted minus initial value", "see unit"),
        number("sigma", "standard deviation of this adjustment alone", "see unit", nullable=True),
        number("sigma_prior", "standard deviation of the given initial value", "see unit", nullable=True),
        number(
            "sigma_over_prior",
            "sigma divided by sigma_prior, both for one σ0; near 1, the adjustment added no information",
            nullable=True,
        ),
        text("unit", "unit of value, change and the sigmas"),
        number("t", "change divided by sigma", nullable=True),
        text(
            "status",
            "assessment of the parameter, with t at the project's confidence; a calibration's certificate "
            "tests with its larger σ, to which parameters held fixed contribute",
            values=(
                "significant",
                "not_significant",
                "eliminated",
                "fixed",
                "considered",
                "prior_only",
                "not_determinable",
            ),
        ),
    ),
    ("parameter", "entity"),
)

SELF_CALIBRATION = TableSchema(
    "self_calibration",
    "An additional parameter that was offered to the adjustment, and the decision about it.",
    (
        text("parameter", "name SET:NAME"),
        text("entity", "camera, or camera and flight, it belongs to"),
        *OWNER[:2],
        text("meaning", "what it models"),
        text("formula", "origin of its formula", values=("published", "reconstructed")),
        text("unit", "unit of the values and their sigmas"),
        number("value", "adjusted value; null if eliminated", "see unit", nullable=True),
        number("sigma", "standard deviation; null if eliminated", "see unit", nullable=True),
        number("t", "change divided by its standard deviation; null if eliminated", nullable=True),
        number("value_of_all", "change with all parameters together", "see unit", nullable=True),
        number("sigma_of_all", "standard deviation with all parameters together", "see unit", nullable=True),
        number("t_of_all", "change divided by its standard deviation with all together", nullable=True),
        number("strongest_correlation", "strongest correlation with all together", nullable=True),
        text("correlated_with", "parameter with the strongest correlation, and its entity", nullable=True),
        text("correlated_parameter", "this parameter alone", nullable=True),
        text("correlated_entity", "its entity", nullable=True),
        number("total_correlation", "correlation with all other free system parameters", nullable=True),
        number("effect_max_um", "largest correction in the image"),
        number("effect_rms_um", "root mean square of the correction over the image"),
        text("decision", "final decision", values=("is significant", "is eliminated", "is kept")),
        count("step", "number of the last decision about it, 0 without a selection"),
        text("reason", "why"),
    ),
    ("parameter", "entity"),
)

CORRELATIONS = TableSchema(
    "correlations",
    "Correlation of two system parameters.",
    (
        text("parameter_a", "name of the first"),
        text("entity_a", "entity of the first"),
        text("parameter_b", "name of the second"),
        text("entity_b", "entity of the second"),
        number("correlation", "coefficient, −1 to 1"),
    ),
    ("parameter_a", "entity_a", "parameter_b", "entity_b"),
)

PARAMETER_INFLUENCES = TableSchema(
    "parameter_influences",
    "Change of a system parameter of a camera or flight if an observation changes by one unit.",
    (
        text("parameter", "name, e.g. boresight_roll"),
        text("entity", "camera or flight it belongs to"),
        text(
            "observation",
            "kind of the observation",
            values=("position", "attitude", "strip_bias", "control"),
        ),
        text("name", "image, strip or point of the observation"),
        text("unit", "unit of the parameter"),
        *(
            number(
                f"by_{axis}",
                f"per metre of the component {axis}, grid east, north, up (control: true east, north); "
                f"attitude: per degree about the axis {axis} of the body",
                "see unit",
            )
            for axis in "xyz"
        ),
        *(
            number(
                f"sigma_{axis}",
                f"standard deviation the component {axis} of the observation had in the adjustment",
                "m, deg",
                nullable=True,
            )
            for axis in "xyz"
        ),
    ),
    ("parameter", "entity", "observation", "name"),
)
