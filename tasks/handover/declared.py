"""The deliveries that a project declares: written from its published results, each a gate of the run."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from tasks.errors import InputError, Location
from tasks.files.installation import writing_into
from tasks.handover.delivery import Angles
from tasks.handover.export import DeliveryRefusedError, export_results
from tasks.handover.receiver import REFUSED_PX
from tasks.handover.written_files import STATEMENT, remove_written
from tasks.results.manifest import read_manifest
from tasks.results.quality_gates import GateResult
from tasks.results.summary import DeliveryFigure, Summary, write_summary
from tasks.settings.deliver import OFFERS, DeliverSettings
from tasks.settings.project import Project
from tasks.store.store import Store


def deliver(store: Store, project: Project, summary: Summary) -> Summary:
    """Write the deliveries of a project, and record their outcome in the summary of its published results.

    A delivery that is refused stops no other; it fails its gate, and an earlier one in its folder is gone.
    """
    directory = store.folder.parent
    made = [_delivered(directory, one) for one in project.deliver]
    gates = (*summary.gates, *(_gate(figure) for figure, _ in made))
    problems = [sentence for _, sentence in made if sentence]
    if store.remote is not None:
        problems.append(
            f"The deliveries are in {directory} only: object storage contains tables and pages only. On "
            "other machines, write them with `aerocal export` after `aerocal fetch`."
        )
    told = summary.model_copy(
        update={
            "deliveries": tuple(figure for figure, _ in made),
            "gates": gates,
            "status": "done" if all(gate.passed for gate in gates) else "gate_failed",
            "problems": (*problems, *summary.problems),
        }
    )
    with writing_into(directory):
        write_summary(directory, told)
    manifest = read_manifest(directory)
    if store.remote is not None and manifest is not None:
        store.remote.publish(manifest.to_json(), told.to_json(), ())
    return told


def _delivered(directory: Path, wanted: DeliverSettings) -> tuple[DeliveryFigure, str]:
    """The outcome of a delivery, and a sentence if it was refused."""
    folder, misfit, trouble = directory / wanted.place, None, ""
    try:
        _clear(folder)
        angles = Angles(wanted.angles, wanted.unit)
        misfit = export_results(directory, wanted.format, folder, wanted.world, angles).misfit_px
    except InputError as error:
        misfit = error.misfit_px if isinstance(error, DeliveryRefusedError) else None
        trouble = f"The delivery {wanted.place} ({wanted.format}) is refused. {error}"
    world = wanted.world or OFFERS[wanted.format].worlds[0]
    figure = DeliveryFigure(
        format=wanted.format, folder=wanted.place, world=world, misfit_px=misfit, written=not trouble
    )
    return figure, trouble


def _clear(folder: Path) -> None:
    """Remove an earlier delivery, and nothing else.

    Raises
    ------
    InputError
        If there has never been a delivery in the folder, but something else.
    """
    if not folder.exists():
        return
    if not folder.is_dir() or (any(folder.iterdir()) and not (folder / STATEMENT).is_file()):
        raise Location(folder).error(
            "The folder contains other files than a delivery.", "Give the delivery another `folder`."
        )
    remove_written(folder)
    with suppress(OSError):
        # Others have put files into it.
        folder.rmdir()


def _gate(figure: DeliveryFigure) -> GateResult:
    return GateResult(
        name=f"delivery_{figure.folder}",
        value=figure.misfit_px,
        limit=REFUSED_PX,
        unit="px",
        passed=figure.written,
    )
