"""From the outcome of a command to its documented exit code and one line on the screen."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

import typer

from flows.command.extras import missing_extra

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


def end_with(action: Callable[[], int]) -> NoReturn:
    """Carry out a command and end with its exit code; expected errors become one line on stderr."""
    # Imported late: --help needs no error classes of the stages.
    from tasks.errors import AerocalError, InputError, NotComputableError

    try:
        code = action()
    except ImportError as error:
        sentence = missing_extra(error)
        if sentence is None:
            raise
        complain(sentence)
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
