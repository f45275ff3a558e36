"""What the last look into the inbox has found, kept for the production page."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import cast

from tasks.storage.json_text import JSON, read_json, replace_json

_FILE = "inbox.json"


@dataclass(frozen=True)
class InboxNews:
    """What the last look has found.

    Attributes
    ----------
    looked : when, ISO 8601, UTC.
    waiting : folders that are not complete yet.
    refused : sentences on marked folders that cannot be started.
    """

    looked: str
    waiting: tuple[str, ...]
    refused: tuple[str, ...]


def keep_inbox_news(state: Path, waiting: Sequence[str], refused: Sequence[str]) -> None:
    """Remember them in the folder of the server; a full disk stops no delivery."""
    news = InboxNews(datetime.now(UTC).isoformat(timespec="seconds"), tuple(waiting), tuple(refused))
    with contextlib.suppress(OSError):
        replace_json(state / _FILE, cast(JSON, asdict(news)))


def forget_inbox_news(state: Path) -> None:
    """There is no inbox (any more)."""
    with contextlib.suppress(OSError):
        (state / _FILE).unlink(missing_ok=True)


def read_inbox_news(state: Path) -> InboxNews | None:
    """What was found; None: there is no inbox, or nobody has looked yet."""
    try:
        content = read_json(state / _FILE)
    except (OSError, ValueError):
        return None
    if not isinstance(content, dict):
        return None
    looked, waiting, refused = (content.get(name) for name in ("looked", "waiting", "refused"))
    if not isinstance(waiting, list) or not isinstance(refused, list):
        return None
    return InboxNews(str(looked), tuple(map(str, waiting)), tuple(map(str, refused)))
