"""The automation that ends runs whose signs of life have stopped.

A run says every half minute (`flows.prefect_settings.HEARTBEAT_S`) that it lives; so does one that is started
by hand and reported to the server. If its machine dies, nobody else can tell. The automation lives in the
server, so that it holds for runs on every machine; it changes no run that has ended.
"""

from __future__ import annotations

from typing import Any

from flows.serving.api import Api

#: Name of the automation; one of this name that differs is replaced.
NAME = "aerocal: runs without signs of life"
#: Seconds without any event of a run after which it counts as ended: four heartbeats.
SILENCE_S = 120


def watch_heartbeats(api: Api) -> None:
    """See to it that the server has the automation, as it is meant, once.

    Raises
    ------
    InstallationError
        If the server cannot be reached, or refuses.
    """
    meant = automation()
    found = api.post("/automations/filter", {"automations": {"name": {"any_": [NAME]}}, "limit": 10})
    for one in found[1:]:
        api.delete(f"/automations/{one['id']}")
    if not found:
        api.post("/automations/", meant)
    elif not _holds(found[0], meant):
        api.put(f"/automations/{found[0]['id']}", meant)


def automation() -> dict[str, Any]:
    """The automation as the server's API takes it."""
    return {
        "name": NAME,
        "description": f"A run that has said nothing for {SILENCE_S} s is Crashed; made by aerocal serve.",
        "enabled": True,
        "trigger": {
            "type": "event",
            "posture": "Proactive",
            "match": {"prefect.resource.id": "prefect.flow-run.*"},
            "after": ["prefect.flow-run.heartbeat"],
            # The names of our own states are events, too; any event of a run says that it lives or has ended.
            "expect": ["prefect.flow-run.*"],
            "for_each": ["prefect.resource.id"],
            "threshold": 1,
            "within": SILENCE_S,
        },
        "actions": [
            {
                "type": "change-flow-run-state",
                "state": "CRASHED",
                "message": f"It has given no sign of life for {SILENCE_S} s.",
            }
        ],
    }


def _holds(found: Any, meant: Any) -> bool:
    """Whether something has all that is meant; what the server has added to it does not count."""
    if isinstance(meant, dict):
        return isinstance(found, dict) and all(_holds(found.get(key), meant[key]) for key in meant)
    if isinstance(meant, list) and isinstance(found, list):
        return len(found) == len(meant) and all(map(_holds, found, meant))
    return bool(found == meant)
