"""What a failed request to object storage means: whether waiting can help, and in words what is wrong.

The client tells errors apart in its messages only (``AWS Error NAME during …``); a request without a body
in its answer (HEAD) has the status in place of the name.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from tasks.object_storage.address import ObjectAddress
from tasks.storage.installation import InstallationError

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


def failure_of(error: OSError, address: ObjectAddress) -> Failure:
    """Tell what the client's error means."""
    message = str(error)
    named = _NAME.search(message)
    if named is None:
        return Failure(type(error).__name__ if not error.strerror else error.strerror)
    unparsed = _UNPARSED.search(message)
    name, status = (unparsed[1] if unparsed else named[1]), named[2]
    if name == "NETWORK_CONNECTION":
        return _of_network(message)
    if name == "NO_SUCH_BUCKET":
        return Failure(
            f"there is no bucket '{address.bucket}'",
            "Make the bucket, or correct the address; buckets are never made by aerocal.",
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
            "Set AWS_CA_BUNDLE to the file of the certificates it is to be checked against.",
        )
    return Failure(curl[2][0].lower() + curl[2][1:])


def _in_words(name: str, status: str | None) -> str:
    if name == "UNKNOWN":
        return f"HTTP status {status}"
    return name.replace("_", " ").lower() if name.isupper() else name


def refused(failure: Failure, address: ObjectAddress) -> InstallationError:
    """The error for people where waiting does not help."""
    return InstallationError(f"{address}: {failure.reason}.", failure.remedy or "")
