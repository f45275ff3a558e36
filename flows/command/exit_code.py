"""From the outcome of a command to its documented exit code and one line on the screen.

Where a library is missing, the line names the extra of the installation that it belongs to.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

import typer

DONE = 0
DEFECT = 1
INPUT_ERROR = 2
NOT_COMPUTABLE = 3
GATE_FAILED = 4

OF_STATUS = {
    "done": DONE,
    "gate_failed": GATE_FAILED,
    "input_error": INPUT_ERROR,
    "not_computable": NOT_COMPUTABLE,
}
#: Extra that brings a library, by the name under which it is imported.
EXTRA_OF = {
    "prefect": "server",
    "fastapi": "server",
    "cronsim": "server",
    "apprise": "server",
    "dash": "server",
    "dash_ag_grid": "server",
    "plotly": "server",
    "waitress": "server",
    "prometheus_client": "server",
    "distributed": "cluster",
    "dask": "cluster",
    "pg8000": "postgresql",
    "rasterio": "images",
}


def end_with(action: Callable[[], int]) -> NoReturn:
    """Carry out a command and end with its exit code; expected errors become one line on stderr."""
    # Imported late: --help needs no error classes of the stages.
    from tasks.errors import AerocalError, InputError, NotComputableError

    try:
        code = action()
    except ImportError as error:
        sentence = _missing_extra(error)
        if sentence is None:
            raise
        complain(sentence)
        code = DEFECT
    except MemoryError as error:
        complain(f"There is not enough memory ({error or 'no more'}). Run again where there is more of it.")
        code = DEFECT
    except PermissionError as error:
        if error.filename is None:
            raise
        complain(f"{error.filename}: {error.strerror}. Correct the permissions, or choose another place.")
        code = DEFECT
    except AerocalError as error:
        complain(str(error))
        kinds = ((InputError, INPUT_ERROR), (NotComputableError, NOT_COMPUTABLE))
        code = next((code for kind, code in kinds if isinstance(error, kind)), DEFECT)
    raise typer.Exit(code)


def complain(error: str) -> None:
    """Print an error in one line on stderr."""
    typer.secho(f"Error: {error}", err=True, fg=typer.colors.RED)


def remark(sentence: str) -> None:
    """Print a remark, which is not an error, in one line on stderr."""
    typer.secho(f"Remark: {sentence}", err=True, fg=typer.colors.YELLOW)


def _missing_extra(error: ImportError) -> str | None:
    """A sentence that says what to install for a missing library; None if it belongs to no extra."""
    library = (error.name or "").partition(".")[0]
    extra = EXTRA_OF.get(library)
    if extra is None:
        return None
    return (
        f"This command needs {library}, which is not installed. "
        f"Install aerocal with its extra: pip install 'aerocal[{extra}]'."
    )
