"""The connection to object storage: endpoint, region and credentials, from the environment and nowhere else.

Nothing of it stands in project files, addresses, logs or manifests. Files of the user's profile and the
metadata service of a cloud are not consulted: a run never waits for an address nobody has named.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from tasks.storage.installation import InstallationError

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
    """How the object storage is reached.

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
        """The open connection, one for a process; opening it asks the storage nothing."""
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
