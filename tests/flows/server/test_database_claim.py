"""Two servers never share a database: each would remove the schedules of the other."""

from __future__ import annotations

import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from sqlalchemy import text

from flows.server.claims import DatabaseClaim, only_server_of, require_server_of
from tasks.files.installation import InstallationError
from tasks.production.records import Records
from tests.conftest import Start
from tests.postgresql_server import PASSWORD, PostgresqlServer
from tests.waiting import until

HOLDING = (
    "import sys; from tasks.production.records import Records\n"
    "from flows.server.claims import only_server_of\n"
    "with only_server_of(Records.at(sys.argv[1]), print):\n    print(flush=True); input()"
)


@pytest.mark.service
def test_a_second_server_is_refused_until_the_first_has_ended(
    postgresql: PostgresqlServer, start: Start
) -> None:
    url = postgresql.url()
    first = start(sys.executable, "-c", HOLDING, url, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert first.stdout is not None
    first.stdout.readline()
    said = rf"uses the database postgresql://.* \(.*, process {first.pid}\)\. Stop it first"
    with pytest.raises(InstallationError, match=said) as refused, only_server_of(Records.at(url), print):
        pass
    assert PASSWORD not in str(refused.value)
    first.kill()
    first.wait()
    for _ in range(2):
        with only_server_of(Records.at(url), print):
            pass


@pytest.mark.service
def test_the_server_that_is_named_is_that_of_the_same_database(
    postgresql: PostgresqlServer, start: Start
) -> None:
    urls = (postgresql.url(), postgresql.copied("template0", "another"))
    holders = [
        start(sys.executable, "-c", HOLDING, url, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        for url in urls
    ]
    for holder, url in zip(holders, urls, strict=True):
        assert holder.stdout is not None
        holder.stdout.readline()
        with pytest.raises(InstallationError, match=rf"process {holder.pid}\)"):
            DatabaseClaim(Records.at(url)).take()


@pytest.mark.service
def test_a_further_runner_is_refused_on_a_database_that_no_server_uses(postgresql: PostgresqlServer) -> None:
    records = Records.at(postgresql.url())
    another = Records.at(postgresql.copied("template0", "another"))
    with only_server_of(records, print):
        require_server_of(records)
        with pytest.raises(InstallationError, match=r"No server uses the database .*/another\. .*--database"):
            require_server_of(another, 0.0)


@pytest.mark.service
def test_errors_of_a_server_are_not_those_of_its_database(postgresql: PostgresqlServer) -> None:
    records = Records.at(postgresql.url())
    with pytest.raises(OSError, match=re.escape("its own")), only_server_of(records, print):
        raise OSError("its own")


def forget_the_lock(records: Records) -> None:
    """End the connection that holds it, as a restart of the database would."""
    ended = "SELECT pg_terminate_backend(pid) FROM pg_locks WHERE locktype = 'advisory' AND objsubid = 2"
    with records.engine.begin() as other:
        assert other.execute(text(ended)).scalars().all() == [True]


@pytest.mark.service
def test_a_database_that_is_restarted_in_between_ends_no_server(postgresql: PostgresqlServer) -> None:
    records = Records.at(postgresql.url())
    with only_server_of(records, print):
        forget_the_lock(records)


@pytest.mark.service
def test_a_server_takes_a_database_again_that_was_restarted(postgresql: PostgresqlServer) -> None:
    records = Records.at(postgresql.url())
    with only_server_of(records, print) as claim:
        forget_the_lock(records)
        claim.keep()
        claim.look()
        with pytest.raises(InstallationError, match="Another server uses"), only_server_of(records, print):
            pass


@pytest.mark.service
def test_a_server_ends_whose_database_another_one_has_taken_while_it_was_restarted(
    postgresql: PostgresqlServer,
) -> None:
    records = Records.at(postgresql.url())
    with only_server_of(records, print) as claim:
        forget_the_lock(records)
        second = DatabaseClaim(records)
        second.take()
        for _ in range(2):
            claim.keep()
            with pytest.raises(InstallationError, match="Another server uses"):
                claim.look()
        second.release()


def _is_away(claim: DatabaseClaim) -> bool:
    try:
        claim.keep()
    except InstallationError as error:
        return "cannot be reached" in str(error)
    return False


def _started(postgresql: PostgresqlServer) -> bool:
    with suppress(subprocess.CalledProcessError):
        postgresql.start()
        return True
    return False


@pytest.mark.service
def test_a_database_that_is_away_is_waited_for(postgresql: PostgresqlServer) -> None:
    claim = DatabaseClaim(Records.at(postgresql.url()))
    claim.take()
    postgresql.kill()
    try:
        for _ in range(2):
            until(lambda: _is_away(claim), 30.0)
            claim.look()
    finally:
        # Not while processes of the killed server are still ending.
        until(lambda: _started(postgresql), 30.0)
    claim.keep()
    with pytest.raises(InstallationError, match="Another server uses"):
        DatabaseClaim(Records.at(postgresql.url())).take()
    claim.release()


def test_a_file_is_held_by_its_state_folder(tmp_path: Path) -> None:
    records = Records.at(str(tmp_path / "records.sqlite"))
    with only_server_of(records, print), only_server_of(records, print):
        assert not list(tmp_path.iterdir())
