"""How the image coordinates were corrected by their mean residuals, step by step."""

from __future__ import annotations

from tasks.document_kit.table import Column, Row, Table, numbers
from tasks.results.figures import GridIterationFigure


def iteration_table(iteration: GridIterationFigure) -> Table:
    """One row for each number of corrections; the last one may have been refused."""
    columns = (
        Column("number", "corrections"),
        Column("sigma0", "σ0"),
        Column("rms_um", "RMS of the means", "µm"),
        Column("noise_um", "by chance", "µm"),
        Column("other_rms_um", "RMS of the means, images left out", "µm"),
    )
    taken = {step.number: step for step in iteration.steps}
    tried = {step.number: step for step in iteration.cross_validation}
    rows = []
    for number in sorted({*taken, *tried}):
        step, other = taken.get(number), tried.get(number)
        own = (None, None, None) if step is None else (step.sigma0, step.rms_um, step.noise_um)
        mean_rms = None if other is None else other.mean_rms_um
        rows.append(Row(str(number), (*numbers((float(number),), 0), *numbers((*own, mean_rms), 3))))
    note = f"No further correction: {iteration.stopped_because}."
    return Table("grid-iteration", "Corrections by mean residuals", columns, tuple(rows), note)
