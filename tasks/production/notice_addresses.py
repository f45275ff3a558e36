"""Where notices go: secret addresses, from the environment or a private file only.

An address may hold a password or a token. None is ever shown, logged or stored: people read its number and
its kind, the outbox holds a slow digest.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from io import StringIO
from pathlib import Path
from uuid import uuid4

import apprise
from apprise.logger import LOGGER_NAME
from apprise.plugins.custom_json import NotifyJSON

from tasks.errors import InputError, Location
from tasks.production.notice import Links, Notice

#: Addresses, separated by spaces or line ends.
ADDRESSES_VARIABLE = "AEROCAL_NOTIFY"
#: Names a file with one address a line, which nobody but its owner may read.
FILE_VARIABLE = "AEROCAL_NOTIFY_FILE"

_TYPES = {
    "gate": apprise.NotifyType.WARNING,
    "failure": apprise.NotifyType.FAILURE,
    "recalibration": apprise.NotifyType.WARNING,
    "success": apprise.NotifyType.SUCCESS,
}
_REFUSED = re.compile(r"error=(\d{3})\b")


@dataclass(frozen=True)
class Sent:
    """Outcome of one message: whether the receiver accepted it, and a sentence about it."""

    accepted: bool
    said: str


@dataclass(frozen=True)
class NoticeAddress:
    """Where notices go.

    Attributes
    ----------
    number : its place among the addresses, from 1.
    kind : e.g. ``json``, ``mailtos``.
    key : what the outbox knows it by.
    """

    number: int
    kind: str
    key: str
    _url: str = field(repr=False)

    def __str__(self) -> str:
        return f"address {self.number} ({self.kind})"

    def send(self, notice: Notice, links: Links) -> Sent:
        """Send a notice and wait until the receiver has taken it, or for some seconds."""
        with _heard() as heard:
            receiver = apprise.Apprise.instantiate(self._url)
            if receiver is None:
                return Sent(False, "the address is not valid")
            receiver.notify_format = apprise.NotifyFormat.TEXT
            if isinstance(receiver, NotifyJSON):
                receiver.payload_extras["notice"] = notice.payload(links)
            everybody = apprise.Apprise()
            everybody.add(receiver)
            accepted = everybody.notify(
                title=notice.subject,
                body=notice.text(links),
                notify_type=_TYPES[notice.kind],
                body_format=apprise.NotifyFormat.TEXT,
            )
        if accepted:
            return Sent(True, "accepted")
        answer = _REFUSED.search(heard.getvalue())
        if answer is not None:
            return Sent(False, f"refused with status {answer[1]}")
        return Sent(False, "not reached, or refused")


def configured_addresses(environment: Mapping[str, str] = os.environ) -> tuple[NoticeAddress, ...]:
    """The addresses of this installation; empty without any.

    Raises
    ------
    InputError
        If an address is not understood (it is not repeated), or the file can be read by others.
    """
    text = environment.get(ADDRESSES_VARIABLE, "")
    file = environment.get(FILE_VARIABLE)
    where = [(one, ADDRESSES_VARIABLE) for one in text.split()]
    if file:
        where += [(one, FILE_VARIABLE) for one in _private_text(Path(file)).split()]
    found: dict[str, NoticeAddress] = {}
    for number, (url, source) in enumerate(where, start=1):
        with _heard():
            receiver = apprise.Apprise.instantiate(url)
        if receiver is None:
            raise InputError(
                f"Address {number} for notices ({source}) is invalid; it is not shown, because it may "
                "contain a password.",
                "Write e.g. jsons://HOST/PATH for a webhook, mailtos://USER:PASSWORD@HOST?to=NAME@DOMAIN for "
                "e-mail; special characters of a password percent-encoded.",
            )
        found.setdefault(url, NoticeAddress(number, url.partition(":")[0].lower(), _key(url), url))
    return tuple(found.values())


def _private_text(file: Path) -> str:
    try:
        mode = file.stat().st_mode
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise Location(file).error(
            f"The file of {FILE_VARIABLE} cannot be read.", "Check its path."
        ) from error
    if mode & 0o077:
        raise Location(file).error("Other users can read this file of addresses.", f"chmod 600 {file}")
    return text


def _key(url: str) -> str:
    """Key that identifies an address without revealing it: slow, to make guessing a password expensive."""
    return hashlib.scrypt(url.encode(), salt=b"aerocal notice address", n=2**14, r=8, p=1, dklen=12).hex()


@contextmanager
def _heard() -> Iterator[StringIO]:
    """Messages of the library while the context lasts; not passed on, because they may contain an address."""
    logger = logging.getLogger(LOGGER_NAME)
    propagated, logger.propagate = logger.propagate, False
    try:
        with apprise.LogCapture(level=logging.WARNING) as said:  # type: ignore[no-untyped-call]
            yield said
    finally:
        logger.propagate = propagated


def send_test_message(environment: Mapping[str, str] = os.environ) -> dict[NoticeAddress, Sent]:
    """Send a message to every address; returns the outcome of each.

    Raises
    ------
    InputError
        If there is no address, or one is not valid.
    """
    addresses = configured_addresses(environment)
    if not addresses:
        raise InputError("There is no address for notices.", f"Set {ADDRESSES_VARIABLE}.")
    now = datetime.now(UTC).isoformat(timespec="milliseconds")
    words = f"This is a test of notices from aerocal on {socket.gethostname()}."
    test = Notice(f"test:{uuid4()}", "success", "", "test", "notify", "Test", words, "", now)
    return {address: address.send(test, Links()) for address in addresses}
