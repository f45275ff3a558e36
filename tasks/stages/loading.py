"""The libraries of the later stages, loaded while the first ones read files.

To read leaves a processor half of the time, and Python takes nearly a second to load what computes.
"""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module
from threading import Thread

_LATER = (
    "tasks.stages.approximate_values",
    "tasks.stages.bundle_adjustment",
    "tasks.documents.report.page",
)


def load_meanwhile() -> None:
    """Begin to load them; who needs one waits for it."""
    Thread(target=_load, name="loading").start()


def _load() -> None:
    # Whoever needs what cannot be loaded says so.
    with suppress(Exception):
        for name in _LATER:
            import_module(name)
        from numba.core.registry import cpu_target

        # What numba does at the first call of any kernel.
        cpu_target.typing_context.refresh()
        cpu_target.target_context.refresh()
