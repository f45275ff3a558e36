"""Where the work of a run whose results go to object storage is done: an ordinary output folder of this user.

It holds what this machine has computed or brought, so the next run need not carry it again; it may be deleted
whenever no run is going on. The name is that of the place, with a digest of address and server: the same
address at another server is another workspace.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping
from pathlib import Path

import platformdirs

from tasks.object_storage.address import ObjectAddress
from tasks.object_storage.connection import endpoint_from

#: Names another folder for them.
WORKSPACES_VARIABLE = "AEROCAL_WORKSPACES"


def local_folder(address: ObjectAddress, environment: Mapping[str, str] = os.environ) -> Path:
    """The folder of this user that stands for an address."""
    named = environment.get(WORKSPACES_VARIABLE)
    parent = Path(named).absolute() if named else Path(platformdirs.user_cache_dir("aerocal")) / "workspaces"
    digest = hashlib.sha256(f"{endpoint_from(environment)} {address}".encode()).hexdigest()[:12]
    shown = re.sub(r"[^\w.-]+", "-", address.prefix)[-40:].strip("-.")
    return parent / f"{shown}-{digest}"
