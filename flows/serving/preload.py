"""What processes of runs need, loaded before any of them is forked (`flows.serving.fork`)."""

from __future__ import annotations

import gc
import pkgutil
import sysconfig
from importlib import import_module
from pathlib import Path

from flows.runs.freed_memory import keep_freed_memory

# Hundreds of thousands of objects, and all of them stay.
gc.set_threshold(50_000)
keep_freed_memory()

from tasks.store.known_sources import listing_of_sources


def installed() -> tuple[str, ...]:
    """What the system says of all source files and of the folders of the libraries; none of them is read."""
    folders = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    return listing_of_sources(), *(str(Path(folder).stat().st_mtime_ns) for folder in sorted(folders))


#: What was installed before anything was loaded. Results are stored under digests of what is installed when
#: they are computed, so nothing older may compute them.
LOADED = installed()

import prefect.engine
import prefect.flow_engine
import prefect.task_engine  # noqa: F401

import flows.stories
from flows.serving import deployed, engine  # noqa: F401

for story in pkgutil.iter_modules(flows.stories.__path__):
    import_module(f"{flows.stories.__name__}.{story.name}")
# No process that is forked looks at them again, and all of them share their memory.
gc.freeze()
