"""The program ``aerocal``, also as ``python -m flows.command``."""

from __future__ import annotations

import gc
import os
import sys
from pathlib import Path

# What lies in the folder of a delivery is data. This process may have been started with `python -m`, and
# those it starts would look for modules there.
if not sys.flags.safe_path and sys.path[0] in ("", str(Path.cwd())):
    del sys.path[0]
os.environ["PYTHONSAFEPATH"] = "1"
if sys.platform == "win32":
    sys.exit("aerocal needs file locks and signals of Linux. On Windows, run it in WSL 2 or in a container.")

from flows.command.interruption import end_on_signals
from flows.runs.freed_memory import keep_freed_memory


def main() -> None:
    """Run the command line; ends the process with the documented exit code."""
    end_on_signals(_command_line)


def _command_line() -> None:
    # Libraries make hundreds of thousands of objects when they are loaded, and all of them stay.
    gc.set_threshold(50_000)
    keep_freed_memory()
    from flows.command.main import app

    app()


if __name__ == "__main__":
    main()
