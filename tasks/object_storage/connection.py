"""The connection to object storage, and requests that outlast an outage of it.

pyarrow's client reads profiles and asks metadata services, repeats some requests in silence, and tells
errors apart in its messages only (``AWS Error NAME during …``; a request without a body in its answer has
the status in place of the name). Here endpoint, region and credentials come from the environment and
nowhere else, a request is repeated for as long as this installation has patience, people are told
meanwhile, and what waiting does not help against is said at once, with a remedy.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar
from urllib.parse import urlsplit

import platformdirs

from tasks.files.installation import InstallationError
from tasks.object_storage.address import ObjectAddress
from tasks.patience import Patience

if TYPE_CHECKING:
    from pyarrow.fs import S3FileSystem

#: Seconds for which a transfer is tried again when the storage does not answer.
PATIENCE_VARIABLE = "AEROCAL_S3_PATIENCE"
#: Seconds without a byte after which a request is given up.
TIMEOUT_VARIABLE = "AEROCAL_S3_TIMEOUT"
_PATIENCE_S = 300.0
_TIMEOUT_S = 30.0
_CONNECT_S = 10.0
_REGION = "us-east-1"


@dataclass(frozen=True)
class Connection:
    """The connection to the object storage.

    Attributes
    ----------
    access_key, secret_key, session_token : credentials; never shown.
    region : of the bucket.
    endpoint : URL of a server that is not Amazon's; None: Amazon's for the region.
    certificates : file of the certificates that the server is checked against; None: those of the system.
    timeout_s : without a byte for so long, a request is given up.
    patience_s : for so long a transfer is tried again.
    """

    access_key: str = field(repr=False)
    secret_key: str = field(repr=False)
    session_token: str | None = field(repr=False)
    region: str
    endpoint: str | None
    certificates: str | None
    timeout_s: float
    patience_s: float

    @cache  # noqa: B019 - there is one connection in a process, and it lives as long
    def filesystem(self) -> S3FileSystem:
        """The open connection, one for a process; opening it sends no request."""
        # Loads the client of S3, which only runs with such an address need.
        from pyarrow.fs import AwsStandardS3RetryStrategy, S3FileSystem

        url = urlsplit(self.endpoint or "https://")
        return S3FileSystem(
            access_key=self.access_key,
            secret_key=self.secret_key,
            session_token=self.session_token,
            region=self.region,
            scheme=url.scheme,
            endpoint_override=url.netloc or None,
            tls_ca_file_path=self.certificates,
            connect_timeout=min(_CONNECT_S, self.timeout_s),
            request_timeout=self.timeout_s,
            # One request for a small object, and no second layer of repetitions under ours.
            allow_delayed_open=True,
            retry_strategy=AwsStandardS3RetryStrategy(max_attempts=1),
        )


def connection_from(environment: Mapping[str, str] = os.environ) -> Connection:
    """The connection that the environment describes.

    Raises
    ------
    InstallationError
        If there are no credentials in it, or a value in it is wrong.
    """
    keys = {name: environment.get(name, "") for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY")}
    missing = [name for name, value in keys.items() if not value]
    if missing:
        raise InstallationError(
            f"There are no credentials for the object storage: {' and '.join(missing)} not set.",
            "Set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY in the environment; profiles are not read.",
        )
    return Connection(
        access_key=keys["AWS_ACCESS_KEY_ID"],
        secret_key=keys["AWS_SECRET_ACCESS_KEY"],
        session_token=environment.get("AWS_SESSION_TOKEN") or None,
        region=environment.get("AWS_REGION") or environment.get("AWS_DEFAULT_REGION") or _REGION,
        endpoint=endpoint_from(environment),
        certificates=environment.get("AWS_CA_BUNDLE") or None,
        timeout_s=_seconds(environment, TIMEOUT_VARIABLE, _TIMEOUT_S),
        patience_s=_seconds(environment, PATIENCE_VARIABLE, _PATIENCE_S, least=0.0),
    )


def endpoint_from(environment: Mapping[str, str] = os.environ) -> str | None:
    """URL of the server that the environment names; None: Amazon's.

    Raises
    ------
    InstallationError
        If it is no URL of a server; it is not repeated, for it may hold a password.
    """
    text = environment.get("AWS_ENDPOINT_URL_S3") or environment.get("AWS_ENDPOINT_URL")
    if not text:
        return None
    url = urlsplit(text)
    if url.scheme not in ("http", "https") or not url.netloc or "@" in url.netloc or url.path.strip("/"):
        raise InstallationError(
            "AWS_ENDPOINT_URL is not the URL of a server.", "Write http://HOST:PORT or https://HOST:PORT."
        )
    return f"{url.scheme}://{url.netloc}"


def _seconds(environment: Mapping[str, str], name: str, default: float, least: float = 0.1) -> float:
    text = environment.get(name)
    if not text:
        return default
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not least <= value <= 1e6:
        raise InstallationError(
            f"{name} is '{text}', not a number of seconds.", f"Set it to e.g. {default:g}."
        )
    return value


_NAME = re.compile(r"AWS Error ([A-Z_]+)(?: \(HTTP status (\d+)\))?")
_UNPARSED = re.compile(r"Unable to parse ExceptionName: (\w+)")
_CURL = re.compile(r"curlCode: (\d+), ([^;]+)")

_CREDENTIALS = {
    "ACCESS_DENIED",
    "INVALID_ACCESS_KEY_ID",
    "SIGNATURE_DOES_NOT_MATCH",
    "INVALID_CLIENT_TOKEN_ID",
    "UNRECOGNIZED_CLIENT",
    "MISSING_AUTHENTICATION_TOKEN",
    "INVALID_SIGNATURE",
    "ACCOUNT_PROBLEM",
    "ExpiredToken",
    "InvalidToken",
}
_OF_REGION = {"PermanentRedirect", "AuthorizationHeaderMalformed", "IllegalLocationConstraintException"}
#: The peer's certificate is not trusted, or the file of certificates cannot be read.
_CURL_CERTIFICATES = {"60", "77"}


@dataclass(frozen=True)
class Failure:
    """Why a request failed.

    Attributes
    ----------
    reason : a few words, nothing secret in them.
    remedy : what to do where waiting does not help; None: waiting may.
    """

    reason: str
    remedy: str | None = None


def failure_of(error: Exception, address: ObjectAddress) -> Failure:
    """The reason for an error of the client."""
    message = str(error)
    named = _NAME.search(message)
    if named is None:
        return Failure(getattr(error, "strerror", None) or type(error).__name__)
    unparsed = _UNPARSED.search(message)
    name, status = (unparsed[1] if unparsed else named[1]), named[2]
    if name == "NETWORK_CONNECTION":
        return _of_network(message)
    if name == "NO_SUCH_BUCKET":
        return Failure(
            f"there is no bucket '{address.bucket}'",
            "Create the bucket, or correct the address; aerocal does not create buckets.",
        )
    if name in _CREDENTIALS or status in ("401", "403"):
        return Failure(
            f"access is denied ({_in_words(name, status)})",
            "Set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY to credentials that may list, read and write "
            "there, and AWS_ENDPOINT_URL to their server.",
        )
    if name in _OF_REGION or status == "301":
        return Failure(
            f"the bucket is not in this region ({_in_words(name, status)})",
            "Set AWS_REGION to the region of the bucket.",
        )
    if status in ("400", "404", "405", "411", "501"):
        return Failure(
            f"the server refuses the request ({_in_words(name, status)})",
            "Check that AWS_ENDPOINT_URL and AWS_REGION are those of an S3-compatible storage.",
        )
    return Failure(_in_words(name, status))


def _of_network(message: str) -> Failure:
    curl = _CURL.search(message)
    if curl is None:
        return Failure("no connection")
    if curl[1] in _CURL_CERTIFICATES:
        return Failure(
            f"its certificate is not trusted ({curl[2]})",
            "Set AWS_CA_BUNDLE to the file of the trusted certificates.",
        )
    return Failure(curl[2][0].lower() + curl[2][1:])


def _in_words(name: str, status: str | None) -> str:
    if name == "UNKNOWN":
        return f"HTTP status {status}"
    return name.replace("_", " ").lower() if name.isupper() else name


R = TypeVar("R")

_log = logging.getLogger("aerocal")


def patiently(
    request: Callable[[], R],
    address: ObjectAddress,
    patience_s: float,
    *,
    pause: Callable[[float], None] = time.sleep,
    now: Callable[[], float] = time.monotonic,
) -> R:
    """Carry out a request, repeated while the storage does not answer.

    Parameters
    ----------
    request : may be repeated from its beginning. That an object does not exist (FileNotFoundError) is an
        answer, and passes, as what is wrong on this machine does.
    patience_s : time after which it is given up.
    pause, now : the clock.

    Raises
    ------
    InstallationError
        If the storage does not answer for so long, or refuses in a way that waiting does not change.
    """
    began, failures = now(), 0

    def say(error: Exception, pause_s: float, waited_s: float) -> None:
        nonlocal failures
        failures += 1
        _log.warning(
            "%s does not answer (%s); retrying in %.0f s, for up to %s",
            address, failure_of(error, address).reason, pause_s, _duration(patience_s - waited_s),
        )  # fmt: skip

    def may_pass(error: Exception) -> bool:
        return _is_of_storage(error) and failure_of(error, address).remedy is None

    try:
        answer = Patience(1.0, 30.0, patience_s).tried(request, may_pass, say, pause=pause, now=now)
    except OSError as error:
        if not _is_of_storage(error):
            raise
        failure = failure_of(error, address)
        if failure.remedy is not None:
            raise InstallationError(f"{address}: {failure.reason}.", failure.remedy) from error
        raise _given_up(address, failure.reason, now() - began) from error
    if failures:
        _log.info("%s answers again after %s", address, _duration(now() - began))
    return answer


def _is_of_storage(error: Exception) -> bool:
    """Whether the storage failed: errors of local files (a full disk) and "no such object" have a number."""
    return isinstance(error, OSError) and error.errno is None


def _given_up(address: ObjectAddress, reason: str, waited_s: float) -> InstallationError:
    return InstallationError(
        f"{address} has not answered for {_duration(waited_s)} ({reason}).",
        "Run again when it answers; completed stages are kept on this machine.",
    )


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"


#: Names another folder for them.
WORKSPACES_VARIABLE = "AEROCAL_WORKSPACES"


def local_folder(address: ObjectAddress, environment: Mapping[str, str] = os.environ) -> Path:
    """The local folder of this user for an address."""
    named = environment.get(WORKSPACES_VARIABLE)
    parent = Path(named).absolute() if named else Path(platformdirs.user_cache_dir("aerocal")) / "workspaces"
    digest = hashlib.sha256(f"{endpoint_from(environment)} {address}".encode()).hexdigest()[:12]
    shown = re.sub(r"[^\w.-]+", "-", address.prefix)[-40:].strip("-.")
    return parent / f"{shown}-{digest}"
