"""The second step of a calibration: means of mountings and flights, and nested tests of the offset."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from tasks.report.figures import (
    OffsetTestFigure,
    StripGroupFigure,
    TwoStepFigure,
    TwoStepParameterFigure,
)
from tasks.report.system_parameters import parameter_words
from tasks.report.table import Cell, Column, Number, Row, Table, decimals_for, numbers, text_column

_COMPONENTS = ("roll", "pitch", "yaw", "forward", "right", "down", "east", "north", "up")
_TESTED = {
    "offset": ("any offset", "none"),
    "lever_arm": ("lever arm", "a GNSS shift alone"),
    "shift": ("GNSS shift", "a lever arm alone"),
    "shift_by_flight": ("GNSS shift of each flight", "one GNSS shift"),
    "lever_arm_by_flight": ("lever arm of each flight", "one lever arm"),
    "lever_arm_by_mounting": ("lever arm of each mounting", "one lever arm"),
}
_VERDICTS = {"not_determinable": "not determinable", "not_called_for": "not called for"}
_MOST_NAMES = 12


def two_step_tables(cameras: Sequence[TwoStepFigure]) -> tuple[Table, ...]:
    """Means and tests; without a second step nothing."""
    return (_means(cameras), _tests(cameras)) if cameras else ()


def _means(cameras: Sequence[TwoStepFigure]) -> Table:
    angles, offsets = _COMPONENTS[:3], _COMPONENTS[3:]
    columns = (
        text_column("camera", "camera"),
        text_column("group", "mean of"),
        Column("images", "images"),
        *(
            Column(name, heading, unit)
            for unit, names in (("deg", angles), ("m", offsets))
            for one in names
            for name, heading in ((one, one), (f"sigma_{one}", "σ"))
        ),
        text_column("strips", "strips"),
    )
    rows = [row for camera in cameras for row in _mean_rows(camera)]
    note = (
        "Mounting 0 is that of most strips and the result. Forward, right, down: as if the whole offset were "
        "a lever arm; east, north, up: as if what the given lever arm leaves were a GNSS shift."
    )
    return Table("two-step-means", "Means by mounting and by flight", columns, tuple(rows), note)


def _mean_rows(camera: TwoStepFigure) -> Iterable[Row]:
    for mounting in camera.mountings:
        names = ", ".join(mounting.strips[:_MOST_NAMES])
        more = f" and {len(mounting.strips) - _MOST_NAMES} more" * (len(mounting.strips) > _MOST_NAMES)
        yield _mean_row(camera.camera, f"mounting {mounting.mounting}", mounting, names + more)
    for flight in camera.flights:
        label = f"flight {flight.flight} (mounting {flight.mounting})"
        yield _mean_row(camera.camera, label, flight, "")


def _mean_row(camera: str, label: str, group: StripGroupFigure, strips: str) -> Row:
    values = (*group.boresight_deg, *group.lever_arm_m, *group.shift_m)
    sigmas = (*group.boresight_sigma_deg, *group.lever_arm_sigma_m, *group.shift_sigma_m)
    cells: list[Cell] = [camera, label, Number(group.images)]
    for value, sigma in zip(values, sigmas, strict=True):
        cells += numbers((value,), decimals_for(sigma), plus=True)
        cells += numbers((sigma,), decimals_for(sigma))
    return Row(f"{camera}@{label}", (*cells, strips))


def _tests(cameras: Sequence[TwoStepFigure]) -> Table:
    columns = (
        text_column("camera", "camera"),
        text_column("tested", "tested"),
        text_column("against", "against"),
        Column("chi_squared", "χ²"),
        Column("freedom", "degrees of freedom"),
        Column("variance_freedom", "of the variance"),
        Column("probability", "probability by chance"),
    )
    rows = tuple(_test_row(camera.camera, test) for camera in cameras for test in camera.tests)
    note = (
        "χ² is the decrease of the squares of the strips' residuals over their variance, which the strips "
        "give themselves: the probability is that of the F-test. Plan only: in height a shift is a lever arm "
        "in every heading. –: these strips do not separate the two."
    )
    return Table("two-step-tests", "What the strips call for", columns, rows, note)


def _test_row(camera: str, test: OffsetTestFigure) -> Row:
    name, _, by = test.tested.partition("_by_")
    tested, against = _TESTED.get(test.tested, (f"{name} of each {by}", f"one {name}"))
    cells: tuple[Cell, ...] = (
        camera,
        tested,
        against,
        *numbers((test.chi_squared,), 1),
        Number(test.freedom),
        Number(test.variance_freedom),
        *numbers((test.probability,), 4),
    )
    return Row(f"{camera}@{test.tested}", cells)


def parameter_table(parameters: Sequence[TwoStepParameterFigure]) -> Table:
    """What a two-step calibration by itself determines."""
    columns = (
        text_column("parameter", "parameter"),
        text_column("camera", "of"),
        Column("value", "value"),
        Column("sigma", "σ"),
        Column("limit", "limit of σ"),
        text_column("unit", "unit"),
        text_column("verdict", "verdict"),
        text_column("because", "because"),
    )
    rows = tuple(
        Row(
            f"{item.parameter}@{item.camera}",
            (
                parameter_words(item.parameter),
                item.camera,
                *numbers((item.value,), decimals_for(item.sigma), plus=True),
                *numbers((item.sigma,), decimals_for(item.sigma)),
                *numbers((item.limit,), decimals_for(item.limit)),
                item.unit,
                _VERDICTS.get(item.verdict, item.verdict),
                item.because,
            ),
        )
        for item in parameters
    )
    return Table("two-step-parameters", "What the second step determines", columns, rows)
