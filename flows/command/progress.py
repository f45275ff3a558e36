"""Progress on stderr: the messages of the stages to the logger ``aerocal``."""

from __future__ import annotations

import logging

from rich.console import Console
from rich.text import Text

_STYLES = {logging.WARNING: "yellow", logging.ERROR: "red"}


class _Screen(Console):
    """A screen on stderr without which a run goes on: a closed pipe or terminal, a full disk."""

    def on_broken_pipe(self) -> None:
        """Print nothing more; Rich would end the process."""
        self.quiet = True


class _ScreenHandler(logging.Handler):
    """Prints messages with the time since the start of the program; warnings in colour."""

    def __init__(self, console: Console) -> None:
        super().__init__(logging.INFO)
        self.console = console

    def emit(self, record: logging.LogRecord) -> None:
        line = Text(f"{record.relativeCreated / 1000:7.1f} s  ", style="dim")
        line.append(record.getMessage(), style=_STYLES.get(record.levelno, "none"))
        try:
            self.console.print(line, soft_wrap=True)
        except OSError:
            self.console.quiet = True


def show_progress(*, on_screen: bool = True) -> Console:
    """Show the stages' messages from now on.

    Parameters
    ----------
    on_screen : whether to print them on stderr; Prefect prints them itself.

    Returns
    -------
    console : where they are printed.
    """
    log = logging.getLogger("aerocal")
    log.setLevel(logging.INFO)
    shown = [handler.console for handler in log.handlers if isinstance(handler, _ScreenHandler)]
    console = shown[0] if shown else _Screen(stderr=True)
    if on_screen and not shown:
        log.addHandler(_ScreenHandler(console))
    return console
