"""The folder in which this user's server and registries keep their state."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

#: Names another folder for the state.
STATE_VARIABLE = "AEROCAL_STATE"


def state_folder() -> Path:
    """Folder of this user: state file, lock, logs and Prefect's database of the server; seen registries."""
    named = os.environ.get(STATE_VARIABLE)
    return Path(named).absolute() if named else Path(platformdirs.user_state_dir("aerocal"))
