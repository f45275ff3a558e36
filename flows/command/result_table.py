"""The result of a run on the screen: problems first, then figures, parameters, gates, files."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from flows.command.calibration_table import calibration_table, parameters_beside_limits, written
from flows.command.screen_table import facts_table, figure, screen, screen_table
from flows.runs.project_run import RunOutcome
from tasks.quantities import shown
from tasks.results.calibration_figures import TwoStepVerdictFigure
from tasks.results.figures import figures_of
from tasks.results.summary import Summary

_STYLES = {"determined": "green", "weak": "yellow", "not_determinable": "bold red", "not_called_for": "dim"}
_VERDICTS = {
    "accepted": ("accepted", "green"),
    "restricted": ("accepted with restrictions", "yellow"),
    "refused": ("refused", "red"),
}


def two_step_table(found: TwoStepVerdictFigure) -> RenderableType:
    """Verdict, and the parameters with their σ and limits."""
    words, colour = _VERDICTS[found.verdict]
    table = parameters_beside_limits("Parameters from the second step", "camera", "value")
    for row in found.parameters:
        unit, factor, decimals = shown(row.unit, "screen")
        numbers = (row.value, row.sigma, row.limit)
        table.add_row(
            row.parameter,
            row.camera,
            *(written(value, factor, decimals) for value in numbers),
            unit,
            Text(row.verdict.replace("_", " "), style=_STYLES[row.verdict]),
        )
    sentence = Text(f"The two-step calibration is {words}.", style=f"bold {colour}")
    return Group(sentence, Text(), table)


_WORDS = {
    "done": ("{}", "bold green"),
    "gate_failed": ("{}, but a quality gate failed", "bold red"),
    "input_error": ("the input is wrong", "bold red"),
    "not_computable": ("not computable", "bold red"),
}
#: Parameters shown on the screen; parameters.parquet has all of them.
# Additional parameters have values such as 1.0e-9 1/mm²: with more decimals than this they are powers of ten.
_MOST_DECIMALS = 7
_SHOWN_PARAMETERS = 30


def show_result(outcome: RunOutcome) -> None:
    """Print the outcome on standard output as tables."""
    screen().print(result_table(outcome))


def result_table(outcome: RunOutcome) -> RenderableType:
    """The outcome of a run that has a result."""
    summary = outcome.summary
    word, style = _WORDS[summary.status]
    checked, adjusted = summary.direct_georeferencing, summary.sigma0 is not None
    figures = figures_of(summary.model_extra)
    calibration, second_step = figures.calibration, figures.two_step_calibration
    adjusted_word = "adjusted" if calibration is None and second_step is None else "calibrated"
    done = " and ".join([adjusted_word] * (adjusted or checked is None) + ["checked"] * (checked is not None))
    parts: list[RenderableType] = [Text(f"\n{word.format(done)}", style=style)]
    parts += [_problems(summary.problems)] if summary.problems else []
    parts += [_figures(summary)] if adjusted or (checked is None and second_step is None) else []
    parts += [] if second_step is None else [two_step_table(second_step)]
    parts += [] if calibration is None else [Text(), calibration_table(summary, calibration)]
    reports = ["report.html"] * (adjusted or checked is None)
    if checked is not None:
        # The models of its figures take long to load.
        from flows.command.georeferencing_table import CHECK_PAGE, georeferencing_table

        parts += [Text(), georeferencing_table(checked)]
        reports.append(CHECK_PAGE)
    estimated = any(item.sigma is not None for item in summary.parameters or ())
    parts += [Text(), _parameters(summary)] if estimated and calibration is None else []
    parts += [Text(), _gates(summary)] if summary.gates else []
    pages = pages_of(outcome, reports, certified=calibration is not None)
    parts.append(Text("\n" + "\n".join(pages)))
    sentences = where_results_are(outcome, "Tables, summary.json and manifest.json")
    parts += [Text(sentence) for sentence in sentences]
    parts += [
        Text(f"Delivery ({one.format}): {outcome.directory / one.folder}")
        for one in summary.deliveries
        if one.written
    ]
    return Group(*parts)


def pages_of(outcome: RunOutcome, reports: Sequence[str], *, certified: bool) -> tuple[str, ...]:
    """Lines that say where the pages of a run are, and its certificates."""
    certificates = sorted(outcome.directory.glob("certificate*.pdf")) if certified else []
    return (
        *(f"Report: {outcome.directory / name}" for name in reports),
        *(f"Certificate: {path}" for path in certificates),
    )


def where_results_are(outcome: RunOutcome, what: str) -> tuple[str, ...]:
    """A sentence that says where the results of a run are."""
    here = f"{what} are in {outcome.directory}"
    if outcome.place == outcome.directory:
        return (here,)
    return (
        here,
        f"Published at {outcome.place}; elsewhere: aerocal fetch {outcome.place} --to DIR",
    )


def _problems(problems: Sequence[str]) -> RenderableType:
    lines = [Text(f"• {sentence}", style="yellow") for sentence in problems]
    return Padding(Group(*lines), (0, 0, 1, 0))


def _figures(summary: Summary) -> Table:
    counts = summary.counts
    rows = [
        ("σ0 (a posteriori / a priori)", figure(summary.sigma0, 3)),
        ("σ0 of an image coordinate", _joined((summary.sigma0_um, 2, "µm"), (summary.sigma0_px, 3, "px"))),
        ("redundancy", figure(summary.redundancy, 0)),
        ("iterations", figure(summary.iterations, 0)),
        ("images, object points", f"{figure(counts.images, 0)}, {figure(counts.object_points, 0)}"),
        (
            "image points, rejected",
            f"{figure(counts.image_points, 0)}, {figure(counts.rejected, 0)}",
        ),
        ("control, check points", f"{figure(counts.control, 0)}, {figure(counts.check, 0)}"),
        ("RMS control X, Y, Z", _components(summary.rmse_control_m)),
        ("RMS check X, Y, Z", _components(summary.rmse_check_m)),
    ]
    rows += _checked(summary)
    if summary.distances is not None:
        found = summary.distances
        rows.append(("distances, check distances", f"{found.used}, {found.check}"))
        rows.append(("RMS of them", f"{figure(found.rms_used_m, 5)}, {figure(found.rms_check_m, 5)} m"))
    return facts_table(rows)


def _checked(summary: Summary) -> list[tuple[str, str]]:
    """Check points against their predicted σ; nothing without them."""
    found = summary.check_point_test
    if found is None:
        return []
    limits = ", ".join(
        "–" if low is None else f"{figure(low, 3)} to {figure(high, 3)}"
        for low, high in zip(found.predicted_low_m, found.predicted_high_m, strict=True)
    )
    means = ", ".join("–" if limit is None else f"±{figure(limit, 3)}" for limit in found.mean_limit_m)
    verdict = "within their limits" if found.passed else "beyond their limits"
    return [
        (f"  expected ({100 * found.confidence:g} %)", f"{limits} m"),
        ("mean check X, Y, Z", _components(found.mean_m)),
        (f"  expected ({100 * found.confidence:g} %)", f"{means} m"),
        ("check points are", verdict),
    ]


def _parameters(summary: Summary) -> Table:
    parameters = summary.parameters or ()
    estimated = [item for item in parameters if item.sigma is not None]
    table = screen_table(
        "parameter", "entity", "value", "± σ", "unit", "status",
        right=("value", "± σ"), whole=("parameter", "unit"), title="System parameters",
    )  # fmt: skip
    for item in estimated[:_SHOWN_PARAMETERS]:
        table.add_row(
            item.parameter,
            item.entity or "",
            _significant(item.value, item.sigma),
            _significant(item.sigma, item.sigma),
            item.unit or "",
            (item.status or "").replace("_", " "),
        )
    others = len(parameters) - table.row_count
    if others:
        table.caption = f"{others} more, including those held fixed or eliminated, in parameters.parquet"
    return table


def _gates(summary: Summary) -> Table:
    table = screen_table("gate", "value", "limit", "", right=("value", "limit"), title="Gates")
    for gate in summary.gates:
        sign = "≤" if gate.bound == "max" else "≥"
        unit = "" if gate.unit == "1" else f" {gate.unit}"
        verdict = Text("passed", style="green") if gate.passed else Text("failed", style="bold red")
        beyond, limit = gate.words
        value = figure(gate.value, 3) if gate.passed or gate.value is None else beyond
        table.add_row(gate.name, f"{value}{unit}", f"{sign} {limit}{unit}", verdict)
    return table


def _joined(*items: tuple[float | None, int, str]) -> str:
    shown = [f"{figure(value, decimals)} {unit}" for value, decimals, unit in items if value is not None]
    return " = ".join(shown) or "–"


def _components(values: Sequence[float | None] | None) -> str:
    return "–" if values is None else ", ".join(figure(value, 3) for value in values) + " m"


def _significant(value: float | None, sigma: float | None) -> str:
    """A value with as many decimals as give its standard deviation two digits."""
    if value is None:
        return "–"
    if not sigma:
        return f"{value:.6g}"
    decimals = max(0, -_exponent(sigma) + 1)
    if decimals > _MOST_DECIMALS:
        return f"{value:.{max(1, _exponent(value or sigma) - _exponent(sigma) + 1)}e}"
    return f"{value:.{decimals}f}"


def _exponent(value: float) -> int:
    return int(f"{abs(value):e}".split("e")[1])
