"""A message that only says that messages arrive."""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from datetime import UTC, datetime
from uuid import uuid4

from tasks.errors import InputError
from tasks.notification.addresses import ADDRESSES_VARIABLE, NoticeAddress, Sent, configured_addresses
from tasks.notification.notice import Links, Notice


def send_test_message(environment: Mapping[str, str] = os.environ) -> dict[NoticeAddress, Sent]:
    """Send a message to every address; what became of each.

    Raises
    ------
    InputError
        If there is no address, or one is not understood.
    """
    addresses = configured_addresses(environment)
    if not addresses:
        raise InputError("There is no address for notices.", f"Set {ADDRESSES_VARIABLE}.")
    now = datetime.now(UTC).isoformat(timespec="milliseconds")
    words = f"Notices of aerocal on {socket.gethostname()} arrive here."
    test = Notice(f"test:{uuid4()}", "success", "", "test", "notify", "Test", words, "", now)
    return {address: address.send(test, Links()) for address in addresses}
