"""The remote side of a store, where other machines find finished outputs and readers find results.

What implements it must not be imported by the store: a stage's key holds all source the stage reaches, and
how files are carried is none of it. Hence documents are handed over as JSON.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Protocol

from tasks.files.json_text import JSON
from tasks.store.stage_key import StageKey


class Remote(Protocol):
    """A place other than the store's folder where finished outputs and results are kept.

    Every method raises InstallationError when the place cannot be reached or refuses.
    """

    def require_access(self) -> None:
        """Check, before anything is computed, that the place can be reached and grants access."""

    def take(self, key: StageKey, folder: Path) -> float | None:
        """Copy the output of a stage into an empty folder, every file checked against its digest.

        Returns
        -------
        seconds : which it once took to compute it. None: there is none, or it is damaged; what is in the
            folder then is of no use.
        """

    def put(self, key: StageKey, folder: Path) -> None:
        """Store a finished output with its ``stage.json``, replacing whatever is there."""

    def put_missing(self, key: StageKey, folder: Path) -> None:
        """Store those parts of a finished output that are missing or have changed."""

    def publish(
        self, manifest: Mapping[str, JSON], summary: Mapping[str, JSON], own: Collection[str]
    ) -> None:
        """Show readers the results of a run whose outputs are already stored.

        Parameters
        ----------
        own : names of everything that such a run may publish; what other kinds of runs have published stays.
        """

    def tell(self, summary: Mapping[str, JSON]) -> None:
        """Record how a run without results ended; those of the previous run are kept."""
