"""Access to the ports: checks of the requested host, the origin, the content and the user.

A browser carries out what any page tells it to, so knowing the port must not be enough, not even on loopback.
Whoever asks knows the password (``user:password``), or is a browser that a link of ours has given a cookie.
This module decides; `flows.server.prefect_server` and `flows.overview.access` apply it to the two servers.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import hmac
import ipaddress
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from urllib.parse import urlsplit

#: Names and origins of our pages, for the processes that serve them; the password has its own variable.
DOOR_VARIABLE = "AEROCAL_DOOR"
#: Where a browser hands over what the link holds.
ENTRANCE = "/enter"
#: Most bytes of what it hands over.
LONGEST_KEY = 4_096
#: How long a browser is known, s.
_KNOWN_S = 365 * 86_400
_WRITING = ("POST", "PUT", "PATCH", "DELETE")


@dataclass(frozen=True)
class Answer:
    """The door's own answer to a request.

    Attributes
    ----------
    status : of HTTP.
    text : a sentence; with headers, a page.
    """

    status: int
    text: str
    headers: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Asked:
    """The parts of a request that decide on access.

    Attributes
    ----------
    method : of HTTP; GET for the first message of a websocket.
    path : without the query.
    headers : (name in small letters, value), as sent.
    """

    method: str
    path: str
    headers: tuple[tuple[str, str], ...]

    def all(self, name: str) -> list[str]:
        """The values of a header."""
        return [value for key, value in self.headers if key == name]

    def one(self, name: str) -> str:
        """The value of a header; "" if it is not there."""
        return next(iter(self.all(name)), "")

    @property
    def is_for_a_page(self) -> bool:
        """Whether a browser requests a page to show."""
        return self.method == "GET" and "text/html" in self.one("accept")


@dataclass(frozen=True)
class Door:
    """The rules of access.

    Attributes
    ----------
    password : ``user:password``.
    names : hosts that requests may be for, besides IP addresses, which no name server can turn to us.
    origins : ``scheme://host:port`` of our pages as browsers know them behind a proxy.
    """

    password: str
    names: frozenset[str]
    origins: frozenset[str]

    @property
    def key(self) -> str:
        """The key in a link: proves that its bearer may read our files, without revealing the password."""
        return self._digest("link")

    @property
    def link(self) -> str:
        """Path of the link; browsers never send what follows #."""
        return f"{ENTRANCE}#{self.key}"

    def answer(self, asked: Asked, content: bytes) -> Answer | None:
        """The door's own answer to a request; None: whoever asks may enter.

        Parameters
        ----------
        content : of a request to the entrance.
        """
        refusal = self.refusal(asked)
        if refusal is not None:
            return refusal
        if asked.path == ENTRANCE:
            if asked.method != "POST":
                return Answer(200, ENTRANCE_PAGE, ENTRANCE_HEADERS)
            if not self.opens(asked, content):
                return Answer(403, "This key is not valid.")
            return Answer(204, "", {"Set-Cookie": self.cookie(asked), "Cache-Control": "no-store"})
        if self.knows(asked):
            return None
        page = Answer(401, ENTRANCE_PAGE, ENTRANCE_HEADERS)
        return page if asked.is_for_a_page else Answer(401, "Unauthorized")

    def refusal(self, asked: Asked) -> Answer | None:
        """Why this request is refused to everyone; None if it is permitted."""
        hosts = asked.all("host")
        if len(hosts) != 1 or not self._is_ours(hosts[0]):
            return Answer(
                400,
                "This server is not known under that name. Use its address, or start it with "
                "--public-url, or with the name in AEROCAL_HOSTS.",
            )
        for origin in asked.all("origin"):
            if origin not in self.origins and urlsplit(origin).netloc.lower() != hosts[0].lower():
                return Answer(403, "Requests from other origins are refused.")
        if asked.method in _WRITING and _has_content(asked):
            kind = asked.one("content-type").partition(";")[0].strip().lower()
            if kind != "application/json":
                return Answer(415, "Only application/json is accepted.")
        return None

    def knows(self, asked: Asked) -> bool:
        """Whether the request carries the password or the cookie."""
        return self._brings_password(asked) or self._brings_cookie(asked)

    def opens(self, asked: Asked, content: bytes) -> bool:
        """Whether the content of a request to the entrance holds the key of the link, or the password.

        Nothing at all will do for who is known already.
        """
        try:
            key = str(json.loads(content)["key"]).strip()
        except (ValueError, TypeError, KeyError, RecursionError):
            return False
        return self.knows(asked) if key == "" else _equal(key, self.key) or _equal(key, self.password)

    def cookie(self, asked: Asked) -> str:
        """The header ``Set-Cookie`` for a browser that has opened the entrance."""
        secure = "; Secure" if asked.one("origin").startswith("https:") else ""
        value = f"{self._cookie_name}={self._digest('cookie')}"
        return f"{value}; Path=/; Max-Age={_KNOWN_S}; HttpOnly; SameSite=Strict{secure}"

    def as_variable(self) -> str:
        """Names and origins as text."""
        return json.dumps({"names": sorted(self.names), "origins": sorted(self.origins)})

    def _is_ours(self, host: str) -> bool:
        found = re.fullmatch(r"(\[[0-9a-fA-F:.]+\]|[^:\[\]/@\s]+)(?::\d{1,5})?", host)
        if found is None:
            return False
        name = found.group(1).strip("[]").lower()
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return name.rstrip(".") in self.names
        return True

    def _brings_password(self, asked: Asked) -> bool:
        scheme, _, coded = asked.one("authorization").partition(" ")
        if scheme.lower() != "basic":
            return False
        try:
            given = base64.b64decode(coded, validate=True).decode()
        except (binascii.Error, ValueError):
            return False
        return _equal(given, self.password)

    def _brings_cookie(self, asked: Asked) -> bool:
        for header in asked.all("cookie"):
            try:
                brought = SimpleCookie(header).get(self._cookie_name)
            except CookieError:
                continue
            if brought is not None and _equal(brought.value, self._digest("cookie")):
                return True
        return False

    @property
    def _cookie_name(self) -> str:
        # Browsers keep cookies by host, not by port: each server has a name of its own.
        return f"aerocal-{self._digest('name')[:12]}"

    def _digest(self, what: str) -> str:
        return hmac.new(self.password.encode(), f"aerocal {what}".encode(), hashlib.sha256).hexdigest()


def door_from(password: str | None, variable: str | None) -> Door:
    """The door of a process, from its variables.

    Raises
    ------
    ValueError
        If there is no password: nothing is served without.
    """
    if not password:
        raise ValueError("no password is set")
    known = json.loads(variable or "{}")
    return Door(password, frozenset(known.get("names", ("localhost",))), frozenset(known.get("origins", ())))


def door_of(password: str, hosts: Iterable[str], pages: Iterable[str | None]) -> Door:
    """The door of a server.

    Parameters
    ----------
    hosts : names under which it is reached.
    pages : addresses of its pages for browsers, where they are not those of its ports.
    """
    parts = [urlsplit(page) for page in pages if page is not None]
    names = {*hosts, "localhost", *(part.hostname for part in parts)}
    origins = {f"{part.scheme}://{part.netloc}".lower() for part in parts}
    return Door(password, frozenset(name.lower().rstrip(".") for name in names if name), frozenset(origins))


def basic(password: str) -> str:
    """The header ``Authorization`` that carries the password."""
    return f"Basic {base64.b64encode(password.encode()).decode()}"


def _has_content(asked: Asked) -> bool:
    return asked.one("content-length") not in ("", "0") or bool(asked.one("transfer-encoding"))


def _equal(given: str, wanted: str) -> bool:
    """Compare in a time that does not depend on how nearly right a guess is."""
    return hmac.compare_digest(given.encode(errors="surrogatepass"), wanted.encode())


_SCRIPT = """
const said = document.getElementById("said");
async function enter(key) {
  const answer = await fetch("/enter", {method: "POST", headers: {"Content-Type": "application/json"},
    body: JSON.stringify({key: key})});
  if (!answer.ok) return false;
  if (sessionStorage.getItem("entered") === location.href) return false;
  sessionStorage.setItem("entered", location.href);
  location.replace(location.pathname === "/enter" ? "/" : location.href);
  return true;
}
const key = location.pathname === "/enter" ? location.hash.slice(1) : "";
if (key) history.replaceState(null, "", "/enter");
enter(key).then(known => { document.getElementById("door").hidden = known; });
document.getElementById("door").addEventListener("submit", async event => {
  event.preventDefault();
  sessionStorage.removeItem("entered");
  if (!await enter(document.getElementById("key").value))
    said.textContent = "This is neither the key of the link nor user:password of this server.";
});
"""

#: What a browser is shown that is not known yet: the link brings it in at once, others are asked.
ENTRANCE_PAGE = f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>aerocal</title>
<style>body{{font:16px/1.5 system-ui,sans-serif;max-width:40rem;margin:4rem auto;padding:0 1rem}}
input{{font:inherit;width:100%;box-sizing:border-box}}</style></head>
<body><form id="door" hidden><h1>This browser is not known yet</h1>
<p>Open the link that <code>aerocal serve</code> showed when it started; it is also in the file
<code>link</code> of its state folder. Or enter user:password of the server.</p> <p><input id="key"
type="password" aria-label="user:password" autocomplete="off"> <button>Enter</button></p>
<p id="said" role="alert"></p></form><script>{_SCRIPT}</script></body></html>"""

_DIGEST = base64.b64encode(hashlib.sha256(_SCRIPT.encode()).digest()).decode()
#: Headers of that page.
ENTRANCE_HEADERS: Mapping[str, str] = {
    "Content-Type": "text/html; charset=utf-8",
    "Content-Security-Policy": f"default-src 'none'; script-src 'sha256-{_DIGEST}'; "
    "style-src 'unsafe-inline'; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
