"""The few calls to the server's API that need no Prefect."""

from __future__ import annotations

import json
import os
import time
import urllib.error
import urllib.request
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from flows.serving.door import basic
from flows.serving.server_process import CLIENT_WORDS
from tasks.storage.installation import InstallationError

#: Seconds between the trials of a call that finds the server's database busy.
_PAUSES_S = (0.5, 1.0, 2.0, 4.0)


@dataclass(frozen=True)
class Api:
    """The API of a Prefect server.

    Attributes
    ----------
    url : its address, with ``/api``.
    words : ``user:password`` it asks for; None: it does not ask.
    """

    url: str
    words: str | None = None

    def get(self, path: str) -> Any:
        """Read something; None if there is no such thing.

        Raises
        ------
        InstallationError
            If the server cannot be reached, or refuses.
        """
        return self._call("GET", path, None)

    def post(self, path: str, body: Mapping[str, Any] | Sequence[Any]) -> Any:
        """Ask for something to be done; the answer. Errors as of `get`."""
        return self._call("POST", path, body)

    def put(self, path: str, body: Mapping[str, Any]) -> None:
        """Replace something. Errors as of `get`."""
        self._call("PUT", path, body)

    def delete(self, path: str) -> None:
        """Remove something. Errors as of `get`."""
        self._call("DELETE", path, None)

    def _call(self, method: str, path: str, body: Mapping[str, Any] | Sequence[Any] | None) -> Any:
        headers = {"Content-Type": "application/json"}
        if self.words is not None:
            headers["Authorization"] = basic(self.words)
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(f"{self.url}{path}", data, headers, method=method)
        try:
            text = _answer(request)
        except urllib.error.HTTPError as error:
            with error:
                if error.code == 404 and method == "GET":
                    return None
                said = error.read(2000).decode(errors="replace")
            raise InstallationError(
                f"The server {self.url} refused {path} ({error.code}): {said}", "See its log."
            ) from error
        except OSError as error:
            raise InstallationError(
                f"The server {self.url} does not answer ({error}).", "See its log."
            ) from error
        return json.loads(text) if text else None


def _answer(request: urllib.request.Request) -> bytes:
    """What the server says; one whose database is busy (503: nothing was done) is asked again a few times."""
    for pause_s in _PAUSES_S:
        try:
            with urllib.request.urlopen(request, timeout=30) as answer:
                return bytes(answer.read())
        except urllib.error.HTTPError as error:
            if error.code != 503:
                raise
            error.close()
            time.sleep(pause_s)
    with urllib.request.urlopen(request, timeout=30) as answer:
        return bytes(answer.read())


def configured_api(environment: Mapping[str, str] = os.environ) -> Api:
    """The API that runs of this process are reported to."""
    return Api(environment["PREFECT_API_URL"].rstrip("/"), environment.get(CLIENT_WORDS))
