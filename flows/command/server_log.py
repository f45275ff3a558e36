"""Output of ``aerocal serve`` and ``aerocal runner``: with date and time, or as JSON."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Annotated, Literal, TypeAlias

import typer

LogFormat: TypeAlias = Literal["text", "json"]
LogFormatOption: TypeAlias = Annotated[
    LogFormat,
    typer.Option(
        "--log-format",
        metavar="text|json",
        help="Format of the output of this command and of the logs in the state folder: lines with date "
        "and time, or one JSON object per line.",
        envvar="AEROCAL_LOG_FORMAT",
    ),
]
#: The formatter of Prefect's own logs, server.log and runner.log.
_PREFECT_FORMATTER = "PREFECT_LOGGING_HANDLERS_CONSOLE_FORMATTER"


def said_as(log_format: LogFormat) -> Callable[[str], None]:
    """Set the format of messages; processes started later write their logs in the same format.

    On a screen, text has no date: it is read at once.
    """
    if log_format == "json":
        os.environ.setdefault(_PREFECT_FORMATTER, "json")
        return lambda sentence: typer.echo(as_json(sentence, datetime.now(UTC)))
    if sys.stdout.isatty():
        return lambda sentence: typer.echo(sentence)
    return lambda sentence: typer.echo(dated(sentence, datetime.now().astimezone()))


def dated(sentence: str, now: datetime) -> str:
    """A message with local date and time in front of each of its lines."""
    return "\n".join(f"{now:%Y-%m-%d %H:%M:%S%z} {line}" for line in sentence.splitlines() or [""])


def as_json(sentence: str, now: datetime) -> str:
    """A message as one line of JSON; time as ISO 8601, UTC."""
    said = {"time": now.isoformat(timespec="milliseconds"), "source": "aerocal", "message": sentence}
    return json.dumps(said, ensure_ascii=False)
