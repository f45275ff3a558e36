"""Statements about accuracy as a stage: ``statements.json`` for programs, ``statements.html`` to sign."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tasks.settings.statement import StatementSettings
from tasks.store.artifact import Artifact
from tasks.store.store import stored

DATA = "statements.json"
PAGE = "statements.html"


@stored("statements")
def write_statements(
    folder: Path,
    *,
    stages: tuple[Mapping[str, Artifact], ...],
    statement: tuple[StatementSettings, ...],
    name: str,
) -> None:
    """Write statements.json and statements.html, and leave the figures in the notes.

    Parameters
    ----------
    stages : the outputs of all stages so far by name, in the order in which they ran.
    statement : which statements are requested.
    name : the project's name.

    Raises
    ------
    InputError
        If a point that is named as vegetated is not a check point.
    """
    # A run that finds the output stored never loads what computes it.
    from tasks.accuracy.check_points import check_point_differences
    from tasks.accuracy.statement import statement as stated
    from tasks.documents.report.statements import render
    from tasks.errors import InputError
    from tasks.files.json_text import replace_json
    from tasks.results.figures import StatementFigure
    from tasks.store.notes import Notes, write_notes
    from tasks.tables.parquet import read_table

    tables = {key: artifact for outputs in stages for key, artifact in outputs.items()}
    check, surveyed = read_table(tables["check_points"]), read_table(tables["control_points"])
    control = len(read_table(tables["control_residuals"]))
    made = []
    for settings in statement:
        unknown = sorted(set(settings.vegetated) - set(check["point"]))
        if unknown:
            raise InputError(
                f"'{unknown[0]}' is listed under `vegetated` of a statement but is not a check point of "
                "this block.",
                "Correct statement.vegetated; it names points of the role check.",
            )
        template = settings.content()
        missing = [one for one in template.tables if one not in tables or read_table(tables[one]).empty]
        found = check_point_differences(check, surveyed, settings.vegetated, control)
        made.append(stated(template, found, settings.wanted, missing))
    content = [one.to_json() for one in made]
    replace_json(folder / DATA, {"project": name, "statements": content})
    figures = tuple(StatementFigure.model_validate(one) for one in content)
    (folder / PAGE).write_text(render(figures, check, name), encoding="utf-8")
    refused = tuple(
        f"The accuracy statement by {one.standard}, {one.edition} says NO: {one.sentence}"
        for one in made
        if not one.passed
    )
    write_notes(folder, Notes(refused, {"accuracy_statements": content}))
