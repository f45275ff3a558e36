"""The page of a camera: every parameter over the years, in one self-contained file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from tasks.document_kit.row_table import table_of, text_of
from tasks.document_kit.table import Column, Number, Row, Table, decimals_for, text_column
from tasks.document_kit.templates import rendered
from tasks.documents.report.page import TEMPLATES as REPORT_TEMPLATES
from tasks.documents.time_series.plot import COLOURS, LIMIT, reference_of, series_plot, time_scale
from tasks.errors import InputError
from tasks.files.installation import write_whole, writing_into
from tasks.registry.contents import StoredCalibration
from tasks.registry.series import ParameterSeries, series_of, shared_numbers

_TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Panel:
    """One parameter: its drawing, and the value the drawing counts from."""

    parameter: str
    reference: str
    drawing: Markup


def write_time_series(file: Path, items: Sequence[StoredCalibration]) -> None:
    """Write the page of a camera with its calibrations.

    Raises
    ------
    InputError
        If none of them has estimated a parameter of the camera.
    """
    page = time_series_page(items)
    with writing_into(file.parent):
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, page)


def time_series_page(items: Sequence[StoredCalibration]) -> str:
    """The page as text."""
    series = series_of(items)
    if not series:
        raise InputError(
            "No calibration of this camera has determined a parameter.", "There is nothing to draw."
        )
    x = time_scale(series)
    panels = [Panel(one.words, _reference(one), series_plot(one, x)) for one in series]
    camera = items[-1].camera
    return rendered(
        "time_series.html.j2",
        _TEMPLATES,
        REPORT_TEMPLATES,
        camera=camera,
        remarks=tuple(shared_numbers(items)),
        items=items,
        panels=panels,
        colours=COLOURS,
        limit=f"{LIMIT:.1f}",
        calibrations=_calibrations(items),
        values=_values(series),
    )


def _reference(series: ParameterSeries) -> str:
    point = reference_of(series)
    return f"{Number(point.value, decimals_for(point.sigma))} {series.unit} (calibration {point.calibration})"


def _calibrations(items: Sequence[StoredCalibration]) -> Table:
    shown = (
        text_of("id", "calibration"),
        text_of("flown", "flown", lambda item: item.flown or "–"),
        text_of("mounting", "mounting", lambda item: item.camera.mounting),
        text_of("state", "state", _state),
        text_of("validity", "flights of", lambda item: item.validity or "–"),
        text_of("by", "by", lambda item: (item.approval or item.events[0]).person),
        text_of("digest", "verification code", lambda item: item.sealed.digest[:12]),
    )
    return table_of("calibrations", "Calibrations", shown, items, lambda item: str(item.id))


def _state(item: StoredCalibration) -> str:
    return item.state + (", refused by the acceptance test" if item.record.verdict == "refused" else "")


def _values(series: Sequence[ParameterSeries]) -> Table:
    """Every value with its σ, and its change from the one before."""
    columns = (
        text_column("parameter", "parameter"), text_column("id", "calibration"), text_column("day", "date"),
        Column("value", "value"), Column("sigma", "σ"), text_column("unit", "unit"),
        Column("change", "change"), Column("t", "in σ"),
    )  # fmt: skip
    rows = []
    for one in series:
        for index, point in enumerate(one.points):
            decimals = decimals_for(point.sigma)
            change, sigma = one.change(index) or (None, 1.0)
            rows.append(
                Row(
                    f"{one.parameter}{one.head and '@'}{one.head}:{point.calibration}",
                    (
                        one.words if index == 0 else "",
                        str(point.calibration),
                        str(point.day),
                        Number(point.value, decimals),
                        Number(point.sigma, decimals),
                        one.unit,
                        Number(change, decimals, plus=True),
                        Number(None if change is None else change / sigma, 1, plus=True),
                    ),
                )
            )
    return Table("values", "Values, and their change from the previous calibration", columns, tuple(rows))
