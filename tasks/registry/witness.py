"""The last state of a registry seen by this machine: its history may grow, but never shrink.

Whoever owns the database can drop the last event and set the head back; nothing in the registry then shows
it. What was seen of it is therefore kept elsewhere, in the state folder of this user, and a history that does
not contain it was cut or rewritten, or comes from an older backup.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path

import platformdirs

from tasks.database.address import DatabaseAddress
from tasks.files.json_text import read_json, replace_json
from tasks.registry.contents import Finding
from tasks.registry.history import Event
from tasks.store.stage_record import utc_now

#: The variable that names the state folder of this user.
STATE_VARIABLE = "AEROCAL_STATE"


def witness_file(address: DatabaseAddress) -> Path:
    """File with the last seen state of a registry."""
    named = os.environ.get(STATE_VARIABLE)
    folder = Path(named).absolute() if named else Path(platformdirs.user_state_dir("aerocal"))
    return folder / "registries" / f"{hashlib.sha256(str(address).encode()).hexdigest()[:16]}.json"


def lost_state(address: DatabaseAddress, events: Sequence[Event]) -> tuple[Finding, ...]:
    """A finding if the last seen state is not part of a history."""
    seen = _seen(address)
    if seen is None or any(event.digest == seen["state"] for event in events):
        return ()
    return (
        Finding(
            f"The history has {len(events)} events and does not contain the state "
            f"{str(seen['state'])[:12]}…, the last of {seen['events']} that this user saw on "
            f"{str(seen['at'])[:10]}: events were removed or rewritten, or an older backup was restored. "
            f"If that was intended, delete {witness_file(address)}."
        ),
    )


def remember(address: DatabaseAddress, events: Sequence[Event]) -> None:
    """Keep the state of a sound registry; a user without a writable folder has no witness."""
    seen = _seen(address)
    if not events or (seen is not None and seen["events"] == len(events)):
        return
    file = witness_file(address)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        state, at = events[-1].digest, utc_now()
        replace_json(file, {"registry": str(address), "events": len(events), "state": state, "at": at})
    except OSError:
        return


def _seen(address: DatabaseAddress) -> dict[str, object] | None:
    try:
        content = read_json(witness_file(address))
    except (OSError, ValueError):
        return None
    known = isinstance(content, dict) and {"events", "state", "at"} <= content.keys()
    return dict(content) if isinstance(content, dict) and known else None
