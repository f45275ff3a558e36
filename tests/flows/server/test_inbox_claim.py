"""Two servers never take deliveries from one inbox."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from flows.server.claims import claimed
from tasks.files.installation import InstallationError
from tests.conftest import Start

HOLDING = (
    "import sys; from pathlib import Path; from flows.server.claims import claimed\n"
    "with claimed(Path(sys.argv[1])):\n    print(flush=True); input()"
)


def test_a_second_server_is_refused_until_the_first_has_ended(tmp_path: Path, start: Start) -> None:
    first = start(sys.executable, "-c", HOLDING, str(tmp_path), stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert first.stdout is not None
    first.stdout.readline()
    said = rf"the inbox {re.escape(str(tmp_path))} \(.*, process {first.pid}\)\. Stop it first"
    with pytest.raises(InstallationError, match=said), claimed(tmp_path):
        pass
    with claimed(None):
        pass
    first.kill()
    first.wait()
    with claimed(tmp_path):
        pass
    with claimed(tmp_path):
        assert [path.name[0] for path in tmp_path.iterdir()] == ["."]


def test_an_inbox_that_cannot_be_written_is_served_without(tmp_path: Path) -> None:
    (tmp_path / ".aerocal.lock").mkdir()
    with claimed(tmp_path), claimed(tmp_path):
        pass
