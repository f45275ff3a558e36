"""Two servers never share a database: each would remove the schedules of the other."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from sqlalchemy import text

from flows.server.claims import only_server_of
from tasks.files.installation import InstallationError
from tasks.production.records import Records
from tests.conftest import Start
from tests.postgresql_server import PASSWORD, PostgresqlServer

HOLDING = (
    "import sys; from tasks.production.records import Records\n"
    "from flows.server.claims import only_server_of\n"
    "with only_server_of(Records.at(sys.argv[1])):\n    print(flush=True); input()"
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
    with pytest.raises(InstallationError, match=said) as refused, only_server_of(Records.at(url)):
        pass
    assert PASSWORD not in str(refused.value)
    first.kill()
    first.wait()
    for _ in range(2):
        with only_server_of(Records.at(url)):
            pass


@pytest.mark.service
def test_errors_of_a_server_are_not_those_of_its_database(postgresql: PostgresqlServer) -> None:
    with pytest.raises(OSError, match=re.escape("its own")), only_server_of(Records.at(postgresql.url())):
        raise OSError("its own")


@pytest.mark.service
def test_a_database_that_is_restarted_in_between_ends_no_server(postgresql: PostgresqlServer) -> None:
    records = Records.at(postgresql.url())
    with only_server_of(records), records.engine.begin() as other:
        ended = "SELECT pg_terminate_backend(pid) FROM pg_locks WHERE locktype = 'advisory' AND objsubid = 2"
        assert other.execute(text(ended)).scalars().all() == [True]


def test_a_file_is_held_by_its_state_folder(tmp_path: Path) -> None:
    records = Records.at(str(tmp_path / "records.sqlite"))
    with only_server_of(records), only_server_of(records):
        assert not list(tmp_path.iterdir())
