"""Receivers of notices for the tests: a web server and a mail server on this machine, both real."""

from __future__ import annotations

import json
import socketserver
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from email import message_from_bytes, policy
from email.message import EmailMessage
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, cast


@dataclass
class WebReceiver:
    """A web server that takes notices.

    Attributes
    ----------
    port : where it listens.
    answers : the first statuses it answers with; 200 after them.
    asked : what was sent, accepted or not.
    accepted : what it has accepted.
    """

    port: int
    answers: list[int] = field(default_factory=list)
    asked: list[Any] = field(default_factory=list)
    accepted: list[Any] = field(default_factory=list)

    @property
    def address(self) -> str:
        return f"json://127.0.0.1:{self.port}/secret-token"


@contextmanager
def web_receiver(answers: Sequence[int] = (), port: int = 0) -> Iterator[WebReceiver]:
    """A web server while the context lasts."""
    received = WebReceiver(port, list(answers))

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            content = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            status = received.answers.pop(0) if received.answers else 200
            received.asked.append(content)
            if status == 200:
                received.accepted.append(content)
            self.send_response(status)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_arguments: object) -> None:
            pass

    with _listening(ThreadingHTTPServer(("127.0.0.1", port), Handler)) as used:
        received.port = used
        yield received


@dataclass
class MailReceiver:
    """A mail server that keeps what it is given."""

    port: int = 0
    letters: list[EmailMessage] = field(default_factory=list)

    @property
    def address(self) -> str:
        ports = f"127.0.0.1:{self.port}"
        return f"mailto://{ports}/?from=aerocal@example.org&to=manager@example.org&mode=insecure"


@contextmanager
def mail_receiver() -> Iterator[MailReceiver]:
    """A mail server while the context lasts: as much of SMTP as a client needs to hand over a letter."""
    received = MailReceiver()

    class Handler(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            self._say("220 here")
            for line in iter(self.rfile.readline, b""):
                verb = line[:4].upper()
                if verb == b"DATA":
                    self._say("354 go on")
                    received.letters.append(self._letter())
                self._say("221 bye" if verb == b"QUIT" else "250 well")
                if verb == b"QUIT":
                    return

        def _letter(self) -> EmailMessage:
            lines = list(iter(self.rfile.readline, b".\r\n"))
            return cast(EmailMessage, message_from_bytes(b"".join(lines), policy=policy.default))

        def _say(self, text: str) -> None:
            self.wfile.write(f"{text}\r\n".encode())

    with _listening(socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler)) as port:
        received.port = port
        yield received


@contextmanager
def _listening(server: socketserver.TCPServer) -> Iterator[int]:
    thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    thread.start()
    try:
        yield int(server.server_address[1])
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
