"""Carry out ``aerocal registry list`` and ``show``."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from itertools import pairwise
from pathlib import Path

from rich.table import Table
from rich.text import Text

from flows.command.exit_code import DONE, INPUT_ERROR, complain
from flows.command.registry_actions import opened
from flows.command.registry_words import (
    as_json as json_of,
)
from flows.command.registry_words import (
    calibrations_table,
    history_table,
    parameters_table,
)
from flows.command.screen_table import facts_table, print_listed, screen, screen_table
from tasks.document_kit.table import Number, decimals_for
from tasks.documents.time_series.plot import LIMIT
from tasks.errors import InputError
from tasks.files.json_text import json_text
from tasks.quantities import shown
from tasks.registry.approval import predecessor
from tasks.registry.compatibility import compatibility
from tasks.registry.contents import Contents, StoredCalibration
from tasks.registry.history import Validity
from tasks.registry.radiometric import RadiometricResult, changes
from tasks.registry.series import ParameterSeries, series_of, shared_numbers


def list_calibrations(camera: str | None, address: str | None, *, as_json: bool) -> int:
    """Print the calibrations, camera by camera, and what was edited."""
    registry = opened(address)
    contents, examined = registry.contents(), registry.radiometric()
    examined = tuple(one for one in examined if camera is None or camera in one.record.names)
    # A camera of which there are radiometric results alone is known, too.
    only_examined = camera is not None and examined and not _is_calibrated(contents, camera)
    items = contents.calibrations if camera is None or only_examined else contents.of_camera(camera)
    items = () if only_examined else items
    if as_json:
        print(json_text([json_of(item) for item in items], indent=2))
    else:
        if items or not examined:
            _print_cameras(items)
        print_radiometric(examined)
    if not contents.findings:
        return DONE
    print_listed(screen(stderr=True), (finding.sentence for finding in contents.findings), wrap=False)
    complain("The registry was edited, see above. Restore it from a backup.")
    return INPUT_ERROR


def _is_calibrated(contents: Contents, camera: str) -> bool:
    return any(camera in item.camera.names for item in contents.calibrations)


def _print_cameras(items: Sequence[StoredCalibration]) -> None:
    console = screen()
    if not items:
        console.print("The registry is empty.")
    for key in dict.fromkeys(item.camera.camera_key for item in items):
        own = [item for item in items if item.camera.camera_key == key]
        camera = own[-1].camera
        console.print(Text(f"\n{camera.label}", "bold"))
        console.print(Text(f"{camera.product}, {camera.image}", "dim"))
        print_listed(console, shared_numbers(own), "yellow")
        for mounting in dict.fromkeys(item.camera.mounting for item in own):
            console.print(Text(f"\n{mounting}"))
            console.print(calibrations_table([item for item in own if item.camera.mounting == mounting]))


def show_calibrations(what: str, plot: Path | None, address: str | None, *, as_json: bool) -> int:
    """Show one calibration, or all of a camera."""
    if plot is not None and plot.is_dir():
        raise InputError(f"{plot} is a folder.", "Name a file.", entity="--plot")
    registry = opened(address)
    contents = registry.contents()
    examined = tuple(one for one in registry.radiometric() if what in one.record.names)
    if examined and not _is_calibrated(contents, what):
        show_radiometric(examined, as_json=as_json)
        return DONE
    one = _single(contents, what)
    own = contents.sisters(one.camera) if one is not None else contents.of_camera(what)
    if one is not None:
        one = registry.calibration(str(one.id))
    if as_json:
        print(json_text(json_of(one) if one is not None else [json_of(item) for item in own], indent=2))
    elif one is not None:
        _show_one(one, contents)
    else:
        _show_camera(own)
        show_radiometric(examined, as_json=False)
    if plot is not None:
        from tasks.documents.time_series.page import write_time_series

        write_time_series(plot, own)
        if not as_json:
            screen().print(Text(f"\nPlot: {plot}"), soft_wrap=True)
    return DONE


def _single(contents: Contents, what: str) -> StoredCalibration | None:
    """The calibration with this number; None: it may be the name of a camera."""
    try:
        return contents.calibration(what)
    except InputError:
        if what.isdecimal() and not any(what in item.camera.names for item in contents.calibrations):
            raise
    return None


def _show_one(item: StoredCalibration, contents: Contents) -> None:
    from tasks.documents.certificate.words import in_words

    console, record = screen(), item.record
    console.print(Text(f"\nCalibration {item.id}: {item.camera.label}, version {item.version}", "bold"))
    console.print(_facts(item))
    of_camera = shared_numbers(contents.sisters(item.camera))
    said = map(in_words, (*record.reasons, *record.remarks))
    print_listed(console, (*said, *of_camera), "yellow")
    start = item.approval.validity.start if item.approval and item.approval.validity else None
    before = predecessor(contents, item, Validity(start or item.flown or date.max))
    test = None if before is None else compatibility(record, before.record)
    console.print(Text("\nParameters", "bold"))
    console.print(parameters_table(item, test))
    if before is not None and test is not None:
        console.print(Text(f"\nAgainst {before.label}", "bold"))
        print_listed(console, test.sentences, "" if test.agrees else "yellow")
    console.print(Text("\nHistory", "bold"))
    console.print(history_table(item))
    console.print(Text(f"\nVerification code {item.sealed.digest}"), soft_wrap=True)


def _facts(item: StoredCalibration) -> Table:
    """Camera and origin of a calibration, in two columns."""
    record, camera, flight = item.record, item.camera, item.record.flight
    heights = ", ".join(f"{height:.0f}" for height in flight.heights_m)
    headings = ", ".join(f"{round(heading) % 360}" for heading in flight.headings_deg)
    held = "valid for no flight" if item.validity is None else f"valid for flights {item.validity}"
    return facts_table(
        (
            ("state", f"{item.state}, {held}"),
            ("verdict", f"{record.verdict} by the acceptance test"),
            ("image", f"{camera.product}, {camera.image}"),
            ("mounting", camera.mounting),
            ("flight", f"{flight.project}, {flight.flown or 'date not given'}"),
            ("", f"{flight.images} images in {flight.strips} strips, {flight.control_points} control points"),
            ("", f"heights {heights} m, headings {headings}°"),
            ("σ0, redundancy", f"{record.sigma0:.3f}, {record.redundancy:,}"),
            ("made from", f"{len(record.inputs)} file{'s' * (len(record.inputs) != 1)}"),
            ("software", ", ".join(f"{name} {version}" for name, version in record.software.items())),
        )
    )


def _show_camera(items: Sequence[StoredCalibration]) -> None:
    """The calibrations of a camera, and every parameter from one to the next."""
    _print_cameras(items)
    console = screen()
    found = [series for series in series_of(items) if len(series.points) > 1]
    if not found:
        return
    console.print(Text("\nParameters from one calibration to the next", "bold"))
    table = screen_table(
        "parameter", "ID", "flown", "value", "± σ", "unit", "change", "", "in σ",
        right=("ID", "value", "± σ", "change", "in σ"),
    )  # fmt: skip
    for series in found:
        _add_rows(table, series)
    console.print(table)


def _add_rows(table: Table, series: ParameterSeries) -> None:
    unit, factor, _ = shown(series.unit, "change")
    for index, point in enumerate(series.points):
        decimals = decimals_for(point.sigma)
        change, t = _change(series, index, factor)
        table.add_row(
            series.words if index == 0 else "",
            str(point.calibration),
            "–" if point.flown is None else str(point.flown),
            str(Number(point.value, decimals)),
            str(Number(point.sigma, decimals)),
            series.unit,
            change,
            unit if change else "",
            t,
            end_section=index == len(series.points) - 1,
        )


def _change(series: ParameterSeries, index: int, factor: float) -> tuple[str, Text]:
    found = series.change(index)
    if found is None:
        return "", Text()
    change, sigma = found
    number = Number(change * factor, decimals_for(sigma * factor), plus=True)
    outstanding = abs(change / sigma) > LIMIT
    return str(number), Text(str(Number(change / sigma, 1, plus=True)), "bold yellow" if outstanding else "")


def print_radiometric(results: Sequence[RadiometricResult]) -> None:
    """A line for each result, camera by camera."""
    console = screen()
    for key in dict.fromkeys(one.record.camera_key for one in results):
        own = [one for one in results if one.record.camera_key == key]
        console.print(Text(f"\nRadiometric results of {own[-1].record.label}", "bold"))
        table = screen_table(
            "result", "version", "examined", "verdict", "added by", "on", right=("result", "version")
        )
        for one in own:
            day = one.record.examined.isoformat() if one.record.examined is not None else "–"
            table.add_row(str(one.id), str(one.version), day, one.record.verdict, one.person, one.at[:10])
        console.print(table)


def show_radiometric(results: Sequence[RadiometricResult], *, as_json: bool) -> None:
    """The results of a camera, and the change of every quantity from one to the next."""
    if as_json:
        print(json_text([one.record.model_dump(mode="json") for one in results], indent=2))
        return
    print_radiometric(results)
    console = screen()
    for before, after in pairwise(results):
        console.print(Text(f"\nFrom result {before.id} to result {after.id}", "bold"))
        table = screen_table(
            "quantity",
            "band",
            "then",
            "now",
            "unit",
            "± σ",
            "in σ",
            right=("band", "then", "now", "± σ", "in σ"),
        )
        for one in changes(before.record, after.record):
            decimals = 0 if one.quantity.startswith("defect") else decimals_for(one.sigma)
            numbers = (Number(value, decimals) for value in (one.then, one.now))
            table.add_row(
                one.quantity.replace("_", " "),
                str(one.band),
                *map(str, numbers),
                one.unit,
                str(Number(one.sigma, max(decimals, 1))),
                Text(str(Number(one.t, 1, plus=True)), "bold yellow" if one.drifted else ""),
            )
        console.print(table)
