"""The deliveries of a project as a stage; the work is done in `tasks.handover.declared`."""

from __future__ import annotations

from tasks.results.summary import Summary
from tasks.settings.project import Project
from tasks.store.store import Store


def deliver(store: Store, project: Project, summary: Summary) -> Summary:
    """Write the deliveries that a project declares from its published results; returns their summary."""
    # A run that delivers nothing never loads what writes the formats.
    from tasks.handover.declared import deliver as write_deliveries

    return write_deliveries(store, project, summary)
