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
    """Somewhere finished outputs and results are kept besides the folder of a store.

    Every method raises InstallationError when the place cannot be reached or refuses.
    """

    def require_access(self) -> None:
        """Find out, before anything is computed, whether the place can be reached and lets us in."""

    def take(self, key: StageKey, folder: Path) -> float | None:
        """Bring the output of a stage into an empty folder, every file checked against its digest.

        Returns
        -------
        seconds : which it once took to compute it. None: there is none, or it is damaged; what is in the
            folder then is of no use.
        """

    def put(self, key: StageKey, folder: Path) -> None:
        """Put a finished output there, complete with its ``stage.json``, whatever is there."""

    def put_missing(self, key: StageKey, folder: Path) -> None:
        """Put a finished output there as far as it is missing, or is not as it was put there."""

    def publish(
        self, manifest: Mapping[str, JSON], summary: Mapping[str, JSON], own: Collection[str]
    ) -> None:
        """Make the results of a run, whose outputs are there already, the ones that readers see.

        Parameters
        ----------
        own : names of everything that such a run may publish; what other kinds of runs have published stays.
        """

    def tell(self, summary: Mapping[str, JSON]) -> None:
        """Say how a run ended that has no results; those of the run before stay."""
