"""A PostgreSQL server of Debian's package for the tests: a temporary folder, a free port, gone afterwards."""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pg8000.dbapi

PASSWORD = "not-to-be-printed"


@dataclass
class PostgresqlServer:
    """A running server; every test begins with an empty database."""

    port: int
    user: str | None
    data: Path
    starting: list[str]

    def kill(self) -> None:
        """End the server at once, as if its machine had lost power."""
        master = int((self.data / "postmaster.pid").read_text().splitlines()[0])
        os.kill(master, signal.SIGKILL)

    def start(self) -> None:
        """Start it on the data that are there."""
        subprocess.run(
            self.starting, check=True, user=self.user, cwd="/",
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip

    def url(self, database: str = "postgres", password: str = PASSWORD) -> str:
        return f"postgresql://tester:{password}@127.0.0.1:{self.port}/{database}"

    def copied(self, source: str, name: str) -> str:
        """The URL of a database of this name with all that another has, which nobody is connected to."""
        self._carry_out("template1", f"DROP DATABASE IF EXISTS {name} WITH (FORCE)")
        self._carry_out("template1", f"CREATE DATABASE {name} TEMPLATE {source}")
        return self.url(name)

    def _carry_out(self, database: str, *commands: str) -> None:
        address = {"host": "127.0.0.1", "port": self.port, "database": database, "password": PASSWORD}
        with closing(pg8000.dbapi.connect("tester", **address)) as connection:
            connection.autocommit = True
            for command in commands:
                connection.cursor().execute(command)

    def emptied(self) -> str:
        """The URL of its database, without any tables."""
        self._carry_out("postgres", "DROP SCHEMA public CASCADE", "CREATE SCHEMA public")
        # Whoever empties a registry says so to those who have seen it.
        shutil.rmtree(Path(os.environ["AEROCAL_STATE"]) / "registries", ignore_errors=True)
        return self.url()


def program(name: str) -> str:
    found = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"))
    assert found, "PostgreSQL is missing: make service-deps installs it"
    return str(found[-1])


@contextmanager
def running_server() -> Iterator[PostgresqlServer]:
    # The server refuses to run as root; Debian's package brings a user.
    user = "postgres" if os.geteuid() == 0 else None
    folder = Path(tempfile.mkdtemp(prefix="aerocal-postgresql-"))
    try:
        if user is not None:
            entry = pwd.getpwnam(user)
            os.chown(folder, entry.pw_uid, entry.pw_gid)
        data, words = folder / "data", folder / "password"
        words.write_text(PASSWORD)
        words.chmod(0o644)
        made = [program("initdb"), "-D", data, "-U", "tester", "--pwfile", words, "--auth=scram-sha-256"]
        subprocess.run(
            [*map(str, made), "--encoding=UTF8", "--locale=C.UTF-8", "--no-sync"],
            check=True, capture_output=True, user=user, cwd="/",
        )  # fmt: skip
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = int(free.getsockname()[1])
        options = f"-p {port} -k {folder} -c listen_addresses=127.0.0.1 -c fsync=off"
        start = [program("pg_ctl"), "-D", data, "-w", "-l", folder / "log", "-o", options, "start"]
        stop = [program("pg_ctl"), "-D", data, "-w", "-m", "fast", "stop"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        subprocess.run([*map(str, start)], check=True, user=user, cwd="/", **quiet)  # type: ignore[call-overload]
        try:
            yield PostgresqlServer(port, user, data, [str(part) for part in start])
        finally:
            subprocess.run([*map(str, stop)], check=True, user=user, cwd="/", **quiet)  # type: ignore[call-overload]
    finally:
        shutil.rmtree(folder, ignore_errors=True)
