"""A real S3-compatible server process for the tests, and a gate before it where faults are made.

The server (moto) keeps its objects in memory, so it cannot be ended and started again without losing them. An
outage is made in two ways: the process is stopped by a signal and goes on later (connections are taken, and
nothing is ever answered), or the gate, which all requests pass, closes its port (connections are refused),
answers with a server error, or is slow.
"""

from __future__ import annotations

import http.client
import os
import signal
import ssl
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import IPv4Address
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from tests.ports import free_port

#: A bucket that the tests share; each has a prefix of its own.
BUCKET = "surveys"
CREDENTIALS = {"AWS_ACCESS_KEY_ID": "AKIDEXAMPLE", "AWS_SECRET_ACCESS_KEY": "not-to-be-printed"}
_START_S = 60.0

#: What is done with a request before it is passed on: None passes it, a status answers it.
Rule = Callable[[str, str], int | None]


@dataclass
class Gate:
    """Passes requests on to the server, unless told otherwise.

    Attributes
    ----------
    target : port of the server.
    port : of the gate.
    rule : looks at method and path of every request before it is passed on.
    afterwards : looks at them after the server has answered, before the client knows.
    requests : method and path of everything that came.
    """

    target: int
    port: int = field(default_factory=lambda: free_port("127.0.0.1"))
    rule: Rule = lambda _method, _path: None
    afterwards: Callable[[str, str], None] = lambda _method, _path: None
    requests: list[tuple[str, str]] = field(default_factory=list)
    _server: ThreadingHTTPServer | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def open(self) -> None:
        """Listen; connections are refused until then."""
        gate = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def _pass_on(self) -> None:
                gate.pass_on(self)

            do_GET = do_HEAD = do_PUT = do_POST = _pass_on  # noqa: N815

            def log_message(self, *_: object) -> None:
                pass

        class Server(ThreadingHTTPServer):
            daemon_threads = True
            allow_reuse_address = True

            def handle_error(self, *_: object) -> None:
                # A client that was killed.
                pass

        self._server = Server(("127.0.0.1", self.port), Handler)
        threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True).start()

    def close(self) -> None:
        """Refuse connections."""
        if self._server is not None:
            self._server.shutdown()
            self._server.server_close()
            self._server = None

    def closed_for(self, seconds: float) -> threading.Timer:
        """Close now, and open again after a while."""
        self.close()
        timer = threading.Timer(seconds, self.open)
        timer.start()
        return timer

    def reset(self) -> None:
        """Pass everything on, and forget what came."""
        self.rule = lambda _method, _path: None
        self.afterwards = lambda _method, _path: None
        self.requests.clear()

    def put(self) -> list[str]:
        """Names of the objects that were put, without the bucket."""
        return [path.split("/", 2)[2] for method, path in self.requests if method == "PUT"]

    def pass_on(self, handler: BaseHTTPRequestHandler) -> None:
        """Carry a request to the server and its answer back."""
        # One connection for each request, so that closing the gate closes everything.
        handler.close_connection = True
        body = _body(handler)
        self.requests.append((handler.command, handler.path))
        status = self.rule(handler.command, handler.path)
        if status is not None:
            handler.send_response(status)
            handler.send_header("Content-Length", "0")
            handler.send_header("Connection", "close")
            handler.end_headers()
            return
        connection = http.client.HTTPConnection("127.0.0.1", self.target, timeout=60)
        headers = {name: value for name, value in handler.headers.items() if name.lower() != "expect"}
        connection.request(handler.command, handler.path, body, headers)
        answer = connection.getresponse()
        content = answer.read()
        self.afterwards(handler.command, handler.path)
        handler.send_response(answer.status)
        for name, value in answer.getheaders():
            if name.lower() not in ("connection", "transfer-encoding", "server", "date"):
                handler.send_header(name, value)
        handler.send_header("Connection", "close")
        handler.end_headers()
        if handler.command != "HEAD":
            handler.wfile.write(content)
        connection.close()


def _body(handler: BaseHTTPRequestHandler) -> bytes:
    """The content of a request as it came, with the lengths between its chunks if it comes in chunks."""
    if "Transfer-Encoding" not in handler.headers:
        return handler.rfile.read(int(handler.headers.get("Content-Length") or 0))
    read = bytearray()
    while True:
        line = handler.rfile.readline()
        size = int(line, 16)
        read += line + handler.rfile.read(size) + handler.rfile.readline()
        if size == 0:
            return bytes(read)


@dataclass
class ObjectServer:
    """A running server with a gate before it."""

    process: subprocess.Popen[bytes]
    port: int
    gate: Gate
    certificate: Path | None = None

    def environment(self) -> dict[str, str]:
        """How the programs under test reach it: through the gate."""
        return {
            **CREDENTIALS,
            "AWS_REGION": "eu-central-1",
            "AWS_ENDPOINT_URL": self.gate.url,
            "AEROCAL_S3_TIMEOUT": "1",
        }

    def make_bucket(self, name: str) -> None:
        where = "<LocationConstraint>eu-central-1</LocationConstraint>"
        body = f"<CreateBucketConfiguration>{where}</CreateBucketConfiguration>".encode()
        _asked(urllib.request.Request(f"{self.url}/{name}", body, method="PUT"), self.certificate)

    @property
    def url(self) -> str:
        """The server itself, without the gate."""
        return f"{'http' if self.certificate is None else 'https'}://127.0.0.1:{self.port}"

    @contextmanager
    def stopped(self) -> Iterator[None]:
        """The process does nothing: connections are taken, and nothing is answered."""
        os.kill(self.process.pid, signal.SIGSTOP)
        try:
            yield
        finally:
            os.kill(self.process.pid, signal.SIGCONT)


@contextmanager
def running_object_server(
    folder: Path, certificate: Path | None = None, **environment: str
) -> Iterator[ObjectServer]:
    """A server without any buckets; with a certificate, key included, it speaks TLS."""
    port = free_port("127.0.0.1")
    command = [str(Path(sys.executable).with_name("moto_server")), "-H", "127.0.0.1", "-p", str(port)]
    if certificate is not None:
        command += ["-s", "-c", str(certificate), "-k", str(certificate)]
    with (folder / "server.log").open("wb") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, env={**os.environ, **environment})
    server = ObjectServer(process, port, Gate(port), certificate)
    try:
        _wait_for(server)
        server.gate.open()
        yield server
    finally:
        server.gate.close()
        process.send_signal(signal.SIGCONT)
        process.kill()
        process.wait()


def _asked(request: urllib.request.Request, certificate: Path | None) -> None:
    context = None if certificate is None else ssl.create_default_context(cafile=str(certificate))
    urllib.request.urlopen(request, timeout=30, context=context).close()


def own_certificate(folder: Path) -> Path:
    """A file with a certificate for this machine that nobody trusts yet, and its key."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "object server of the tests")])
    now = datetime.now(UTC)
    certificate = (
        x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number())
        .not_valid_before(now - timedelta(hours=1))
        .not_valid_after(now + timedelta(hours=1))
        .add_extension(
            x509.SubjectAlternativeName([x509.IPAddress(IPv4Address("127.0.0.1"))]), critical=False
        )
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
    forms = (serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    file = folder / "server.pem"
    file.write_bytes(key.private_bytes(*forms) + certificate.public_bytes(serialization.Encoding.PEM))
    return file


def _wait_for(server: ObjectServer) -> None:
    end = time.monotonic() + _START_S
    while True:
        assert server.process.poll() is None, "the object server has ended"
        assert time.monotonic() < end, "the object server does not answer"
        try:
            _asked(urllib.request.Request(f"{server.url}/moto-api/"), server.certificate)
            return
        except OSError:
            time.sleep(0.1)


def on_put(ends: Sequence[str] | str, action: Callable[[], None]) -> Callable[[str, str], None]:
    """Do something once, at the first PUT of an object whose name ends so."""
    pending = [action]

    def look(method: str, path: str) -> None:
        if method == "PUT" and path.endswith(tuple([ends] if isinstance(ends, str) else ends)) and pending:
            pending.pop()()

    return look
