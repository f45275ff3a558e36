"""What is tried again, for how long, and what is said meanwhile; the messages are those the client gives."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from tasks.files.installation import InstallationError
from tasks.object_storage.address import ObjectAddress
from tasks.object_storage.connection import patiently

ADDRESS = ObjectAddress("surveys", "block")
REFUSED = (
    "When uploading object with key 'k' in bucket 'surveys': AWS Error NETWORK_CONNECTION during PutObject "
    "operation: curlCode: 7, Could not connect to server; Details: Failed to connect to 127.0.0.1:1"
)
STOPPED = REFUSED.replace("curlCode: 7, Could not connect to server", "curlCode: 28, Timeout was reached")


def aws(name: str, rest: str = "some message (Request ID: 1)") -> str:
    return f"When reading key 'k' in bucket 'surveys': AWS Error {name} during GetObject operation: {rest}"


@dataclass
class Clock:
    """A clock that only pauses move."""

    time_s: float = 1000.0
    pauses: list[float] = field(default_factory=list)

    def now(self) -> float:
        return self.time_s

    def pause(self, seconds: float) -> None:
        self.pauses.append(seconds)
        self.time_s += seconds


def failing(clock: Clock, message: str, until_s: float) -> Callable[[], str]:
    """A request that fails until the clock shows a time."""

    def request() -> str:
        if clock.now() < until_s:
            raise OSError(message)
        return "answer"

    return request


@pytest.mark.parametrize(
    "message",
    [
        REFUSED,
        STOPPED,
        aws("INTERNAL_FAILURE"),
        aws("SLOW_DOWN"),
        aws("SERVICE_UNAVAILABLE"),
        aws("REQUEST_TIME_TOO_SKEWED"),
        aws("UNKNOWN (HTTP status 500)", "No response body."),
        aws("UNKNOWN (HTTP status 503)", "No response body."),
        aws("UNKNOWN (HTTP status 429)", "Unable to parse ExceptionName: TooManyRequests Message: slowly"),
        "something nobody has thought of",
    ],
)
def test_an_outage_is_outlasted_with_growing_pauses(message: str) -> None:
    clock = Clock()
    request = failing(clock, message, until_s=1100.0)
    assert patiently(request, ADDRESS, 300.0, pause=clock.pause, now=clock.now) == "answer"
    assert clock.pauses == [1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0, 30.0]


def test_an_outage_that_lasts_too_long_ends_with_the_remedy() -> None:
    clock = Clock()
    request = failing(clock, REFUSED, until_s=1e9)
    with pytest.raises(InstallationError) as given_up:
        patiently(request, ADDRESS, 300.0, pause=clock.pause, now=clock.now)
    assert (
        "s3://surveys/block has not answered for 5 min (could not connect to server)" in given_up.value.what
    )
    assert "Run again" in given_up.value.remedy
    assert 300.0 <= sum(clock.pauses) <= 301.0


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (aws("NO_SUCH_BUCKET"), "there is no bucket 'surveys'"),
        (aws("ACCESS_DENIED", "No response body."), "access is denied"),
        (aws("INVALID_ACCESS_KEY_ID"), "AWS_ACCESS_KEY_ID"),
        (aws("SIGNATURE_DOES_NOT_MATCH"), "AWS_SECRET_ACCESS_KEY"),
        (
            aws("UNKNOWN (HTTP status 400)", "Unable to parse ExceptionName: ExpiredToken Message: x"),
            "access is denied",
        ),
        (aws("UNKNOWN (HTTP status 403)", "No response body."), "access is denied"),
        (aws("UNKNOWN (HTTP status 301)", "No response body."), "AWS_REGION"),
        (aws("UNKNOWN (HTTP status 501)", "No response body."), "AWS_ENDPOINT_URL"),
        (
            REFUSED.replace("curlCode: 7, Could not", "curlCode: 60, SSL peer certificate was not"),
            "AWS_CA_BUNDLE",
        ),
    ],
)
def test_what_waiting_does_not_change_ends_at_once(message: str, words: str) -> None:
    clock = Clock()
    with pytest.raises(InstallationError) as refused:
        patiently(failing(clock, message, until_s=1e9), ADDRESS, 300.0, pause=clock.pause, now=clock.now)
    assert words in str(refused.value)
    assert not clock.pauses


def test_nothing_of_the_servers_message_is_repeated() -> None:
    secret = aws("INVALID_ACCESS_KEY_ID", "The key AKIDEXAMPLE you provided does not exist")
    clock = Clock()
    with pytest.raises(InstallationError) as refused:
        patiently(failing(clock, secret, until_s=1e9), ADDRESS, 300.0, pause=clock.pause, now=clock.now)
    assert "AKIDEXAMPLE" not in str(refused.value)


@pytest.mark.parametrize(
    "error", [FileNotFoundError(2, "no such object"), OSError(28, "No space left on device")]
)
def test_an_answer_and_a_full_disk_of_our_own_are_not_waited_for(error: OSError) -> None:
    clock = Clock()

    def request() -> str:
        raise error

    with pytest.raises(OSError, match=r"no such|No space") as raised:
        patiently(request, ADDRESS, 300.0, pause=clock.pause, now=clock.now)
    assert raised.value is error
    assert not clock.pauses


def test_people_are_told_while_it_waits(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "aerocal")
    clock = Clock()
    patiently(failing(clock, STOPPED, 1003.0), ADDRESS, 300.0, pause=clock.pause, now=clock.now)
    assert caplog.messages == [
        "s3://surveys/block does not answer (timeout was reached); retrying in 1 s, for up to 5 min",
        "s3://surveys/block does not answer (timeout was reached); retrying in 2 s, for up to 5 min",
        "s3://surveys/block answers again after 3 s",
    ]
