"""The second step of a calibration: means of mountings and flights, and nested tests of the offset."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeAlias

from tasks.document_kit.row_table import number_of, table_of, text_of
from tasks.document_kit.table import Cell, Column, Row, Table, decimals_for, numbers, text_column
from tasks.quantities import quantity_words
from tasks.results.calibration_figures import (
    StripGroupFigure,
    TwoStepFigure,
    TwoStepParameterFigure,
)

_ANGLES = ("roll", "pitch", "yaw")
_OFFSETS = ("forward", "right", "down", "east", "north", "up")
# Component, value and σ of every mean of a group.
_Means: TypeAlias = Callable[[StripGroupFigure], Iterable[tuple[str, float | None, float | None]]]
_TESTED = {
    "offset": ("any offset", "none"),
    "lever_arm": ("lever arm", "a GNSS shift alone"),
    "shift": ("GNSS shift", "a lever arm alone"),
    "shift_by_flight": ("GNSS shift of each flight", "one GNSS shift"),
    "lever_arm_by_flight": ("lever arm of each flight", "one lever arm"),
    "lever_arm_by_mounting": ("lever arm of each mounting", "one lever arm"),
}
_VERDICTS = {"not_determinable": "not determinable", "not_called_for": "not needed"}


def two_step_tables(cameras: Sequence[TwoStepFigure]) -> tuple[Table, ...]:
    """Means, mountings and tests; without a second step nothing."""
    if not cameras:
        return ()
    of_boresight = _means(
        "two-step-boresights",
        "Boresights by mounting and by flight",
        "deg",
        cameras,
        lambda group: zip(
            ("roll", "pitch", "yaw"), group.boresight_deg, group.boresight_sigma_deg, strict=True
        ),
        "Mounting 0 is the mounting of most strips; its values are the result.",
    )
    of_offset = _means(
        "two-step-offsets",
        "Offsets by mounting and by flight",
        "m",
        cameras,
        lambda group: zip(
            _OFFSETS,
            (*group.lever_arm_m, *group.shift_m),
            (*group.lever_arm_sigma_m, *group.shift_sigma_m),
            strict=True,
        ),
        "Forward, right, down: the whole offset interpreted as a lever arm; east, north, up: the offset "
        "remaining after the given lever arm, interpreted as a GNSS shift.",
    )
    return _mountings(cameras), of_boresight, of_offset, _tests(cameras)


def _mountings(cameras: Sequence[TwoStepFigure]) -> Table:
    rows = [
        {
            "camera": camera.camera,
            "mounting": item.mounting,
            "images": item.images,
            "strips": ", ".join(item.strips),
        }
        for camera in cameras
        for item in camera.mountings
    ]
    shown = (
        text_of("camera", "camera"),
        text_of("mounting", "mounting"),
        number_of("images", "images"),
        text_of("strips", "strips"),
    )
    caption = "Mountings and their strips"
    return table_of("two-step-mountings", caption, shown, rows, "{camera}@mounting {mounting}")


def _means(
    name: str, caption: str, unit: str, cameras: Sequence[TwoStepFigure], means: _Means, note: str
) -> Table:
    """Means with their σ, a row for each mounting and flight."""
    rows: list[Row] = []
    components: list[str] = []
    for camera in cameras:
        groups: list[tuple[str, StripGroupFigure]] = [
            (f"mounting {item.mounting}", item) for item in camera.mountings
        ]
        groups += [(f"flight {item.flight} (mounting {item.mounting})", item) for item in camera.flights]
        for label, group in groups:
            cells: list[Cell] = [camera.camera, label]
            components = []
            for component, value, sigma in means(group):
                components.append(component)
                cells += numbers((value,), decimals_for(sigma), plus=True)
                cells += numbers((sigma,), decimals_for(sigma))
            rows.append(Row(f"{camera.camera}@{label}", tuple(cells)))
    columns = [text_column("camera", "camera"), text_column("group", "mean of")]
    for component in components:
        columns += [Column(component, component, unit), Column(f"sigma_{component}", "σ", unit)]
    return Table(name, caption, tuple(columns), tuple(rows), note)


def _tests(cameras: Sequence[TwoStepFigure]) -> Table:
    # With one flight or one mounting there is nothing to compare.
    rows = [
        {"camera": camera.camera, "words": _tested(test.tested), **test.model_dump()}
        for camera in cameras
        for test in camera.tests
        if test.probability is not None or "_by_" not in test.tested
    ]
    shown = (
        text_of("camera", "camera"),
        text_of("tested", "tested", lambda row: row["words"][0]),
        text_of("against", "against", lambda row: row["words"][1]),
        number_of("chi_squared", "χ²", decimals=1),
        number_of("freedom", "degrees of freedom"),
        number_of("variance_freedom", "of the variance"),
        number_of("probability", "probability by chance", decimals=4),
    )
    note = (
        "χ² is the decrease in the sum of squares of the strip residuals, divided by their variance, which "
        "is estimated from the strips: the probability is that of the F-test. Horizontal only: in height, a "
        "shift cannot be separated from a lever arm. –: these strips do not separate the two."
    )
    return table_of(
        "two-step-tests", "Tests of lever arm and GNSS shift", shown, rows, "{camera}@{tested}", note
    )


def _tested(test: str) -> tuple[str, str]:
    """What is tested against what, in words."""
    name, _, by = test.partition("_by_")
    return _TESTED.get(test, (f"{name} of each {by}", f"one {name}"))


def parameter_table(parameters: Sequence[TwoStepParameterFigure]) -> Table:
    """What a two-step calibration by itself determines."""
    shown = (
        text_of("parameter", "parameter", lambda item: quantity_words(item.parameter)),
        text_of("camera", "of"),
        number_of("value", "value", decimals="sigma", plus=True),
        number_of("sigma", "σ", decimals="sigma"),
        number_of("limit", "limit of σ", decimals="limit"),
        text_of("unit", "unit"),
        text_of("verdict", "verdict", lambda item: _VERDICTS.get(item.verdict, item.verdict)),
        text_of("because", "because"),
    )
    caption = "Parameters determined by the second step"
    return table_of("two-step-parameters", caption, shown, parameters, "{parameter}@{camera}")
