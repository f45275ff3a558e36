"""Fixtures of all tests; above all, a Prefect that knows nothing of this machine."""

from __future__ import annotations

import contextlib
import functools
import gc
import importlib
import os
import signal
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import hypothesis
import pytest
import threadpoolctl

from flows.runs.freed_memory import keep_freed_memory
from tests.chromium import ALONE, chromium
from tests.postgresql_server import PostgresqlServer, running_server

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# The workers of pytest-xdist share the processors already; threads of the linear algebra beside them multiply
# its processor time by up to ten. The variable is for what is loaded later and for programs that tests start.
os.environ.setdefault("OMP_NUM_THREADS", "1")
threadpoolctl.threadpool_limits(int(os.environ["OMP_NUM_THREADS"]))

# As the command does; otherwise the system clears pages again for every array that follows another.
keep_freed_memory()

# Prefect reads its settings when it is imported, so they stand here, before any test module is loaded.
_prefect_home = tempfile.TemporaryDirectory(prefix="aerocal-tests-prefect-")
os.environ["PREFECT_HOME"] = _prefect_home.name
# A server that somebody runs on this machine must not hear of the tests.
os.environ["AEROCAL_STATE"] = str(Path(_prefect_home.name) / "state")
os.environ["DO_NOT_TRACK"] = "1"
#: Names the folder that all workers of pytest-xdist share. The process that starts them makes and removes it.
SHARED_VARIABLE = "AEROCAL_TESTS_SHARED"
if SHARED_VARIABLE not in os.environ:
    _shared = tempfile.TemporaryDirectory(prefix="aerocal-tests-shared-")
    os.environ[SHARED_VARIABLE] = _shared.name
# Whichever test has Prefect set up its logging first: our messages outside a run are no warning.
os.environ["PREFECT_LOGGING_TO_API_WHEN_MISSING_FLOW"] = "ignore"
os.environ["PREFECT_SERVER_ANALYTICS_ENABLED"] = "false"
# No test uses the kinds of blocks that Prefect's server brings; storing them takes it seconds.
os.environ["PREFECT_SERVER_REGISTER_BLOCKS_ON_START"] = "false"
for name in ("PREFECT_API_URL", "PREFECT_PROFILE"):
    os.environ.pop(name, None)
# A shell has what it starts in the background ignore the interrupt key, and so would the programs under test.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# By default the collector of cycles looks after every 700 new objects. One table of pandas makes more, and
# what is made while tests are collected lives to the end.
gc.set_threshold(400_000)

# Waiting for the disk takes a tenth of the time of tests that store results, and no test cuts the power.
# Programs that tests start, and kill, do wait.
os.fsync = lambda _: None

# The same examples in every run, and no test that fails because the machine has other work.
hypothesis.settings.register_profile("aerocal", deadline=None, derandomize=True)
hypothesis.settings.load_profile("aerocal")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """One worker more than processors, because tests also wait; in CI, other checks use that time."""
    return len(os.sched_getaffinity(0)) + (os.environ.get("CI") != "true")


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session: pytest.Session) -> None:
    """Every second worker loads all test files from the last to the first.

    In a fresh clone pytest rewrites the assertions of a file when it loads it, and stores what comes out. Two
    workers meet in the middle, so that each rewrites half of the files.
    """
    number = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    if number % 2 == 0 or session.config.args_source is not pytest.Config.ArgsSource.TESTPATHS:
        return
    for file in sorted(REPOSITORY.glob("tests/**/test_*.py"), reverse=True):
        # What cannot be loaded is reported when it is collected.
        with contextlib.suppress(Exception, pytest.skip.Exception):
            importlib.import_module(".".join(file.relative_to(REPOSITORY).with_suffix("").parts))


def pytest_collection_finish() -> None:
    """Keep the collector of cycles from what lives to the end anyway; the command does the same.

    Looking for garbage before would take each worker half a second.
    """
    gc.freeze()


#: Folders of tests that need hardly any compiled kernel.
WITHOUT_KERNELS = (
    "tests/tasks/files/",
    "tests/tasks/formats/",
    "tests/tasks/image_files/",
    "tests/tasks/inventory/",
    "tests/tasks/production/",
    "tests/tasks/registry/",
    "tests/tasks/settings/",
    "tests/tasks/store/",
    "tests/tasks/tables/",
)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> object:
    """Files whose tests need Prefect's server go to one worker; of a whole run, the longest come first.

    In a fresh clone all kernels are compiled in the first minute. Two workers that begin with adjustments
    wait for one another then, so all but the first begin with files that hardly need any.
    """
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS

    class OneServer(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return "prefect" if "mark.prefect" in _text_of(file) else file

        def _assign_work_unit(self, node: Any) -> None:
            if whole:
                first = node is self.nodes[0]
                chosen = min(self.workqueue, key=lambda file: _place(file, compiles=first))
                self.workqueue.move_to_end(chosen, last=False)
            super()._assign_work_unit(node)

    return OneServer(config, log)


def _place(file: str, *, compiles: bool) -> int:
    """When a worker takes a file: flows have the longest tests, short ones at the end keep workers busy."""
    if not compiles and file.startswith(WITHOUT_KERNELS):
        return -1
    if file == "prefect" or file.startswith("tests/flows/"):
        return 0
    return 2 if file.startswith("tests/tasks/") else 1


@functools.cache
def _text_of(file: str) -> str:
    return (REPOSITORY / file).read_text(encoding="utf-8")


#: A small valid project.
PROJECT = """
version = 1
[project]
name = "small"
crs = "local"
heights = "ellipsoidal"
[cameras.C]
columns = 100
rows = 80
pixel_um = 5.0
focal_length_mm = 0.5
principal_point_mm = [0.0, 0.0]
pixel_origin = "corner"
mount_deg = 0
[inputs.image_points]
file = "image_points.csv"
format = "csv"
unit = "px"
[inputs.exposures]
file = "exposures.csv"
format = "csv"
crs = "local"
heights = "ellipsoidal"
position = "projection_centre"
angles = { order = "omega-phi-kappa", unit = "deg", reference = "grid" }
"""

REPOSITORY = Path(__file__).resolve().parents[1]

#: The fixture `start`.
Start: TypeAlias = Callable[..., subprocess.Popen[str]]


@pytest.fixture(scope="session")
def test_data() -> Path:
    """Folder of the real data; its absence skips a test, except in the continuous integration."""
    folder = Path(os.environ.get("AEROCAL_TEST_DATA", REPOSITORY.parent / "shared" / "data")).resolve()
    if folder.is_dir():
        return folder
    message = f"the real data are not at {folder}; set AEROCAL_TEST_DATA to their folder"
    if os.environ.get("CI") == "true":
        pytest.fail(message)
    pytest.skip(message)


@pytest.fixture(scope="session")
def prefect_server() -> Iterator[None]:
    """Prefect's temporary server, once for all tests that need one."""
    from prefect.logging.configuration import ensure_logging_setup
    from prefect.testing.utilities import prefect_test_harness

    # Prefect takes all handlers away when it sets up logging: in a test, that of `caplog`.
    ensure_logging_setup()
    with prefect_test_harness(server_startup_timeout=120):
        yield


@pytest.fixture(scope="session")
def postgresql() -> Iterator[PostgresqlServer]:
    """A PostgreSQL server, once for all tests that need one."""
    with running_server() as server:
        yield server


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A browser that finds no other host than this machine, once for all tests of a file.

    Not for longer: as long as it runs, no other test of its process can start an event loop.
    """
    with chromium(ALONE) as browser:
        yield browser


@pytest.fixture
def start() -> Iterator[Start]:
    """Starts programs as `subprocess.Popen` does; none, nor what it has started, outlives the test."""
    started: list[subprocess.Popen[str]] = []

    def start_one(*command: str | Path, **options: Any) -> subprocess.Popen[str]:
        process = subprocess.Popen([*map(str, command)], text=True, start_new_session=True, **options)
        started.append(process)
        return process

    yield start_one
    for process in started:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        # Closes the pipes and takes the exit code, of which the next test would complain otherwise.
        process.communicate()


@pytest.fixture
def write_project() -> Callable[..., Path]:
    """Writes a small valid project with its deliveries, for tests of what is around the stages."""

    def write(folder: Path, more: str = "") -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "image_points.csv").write_text("image,point,x,y\n1,a,10,10\n2,a,20,20\n")
        (folder / "exposures.csv").write_text(
            "image,camera,strip,x,y,z,omega,phi,kappa\n1,C,s,0,0,100,0,0,0\n2,C,s,10,0,100,0,0,0\n"
        )
        file = folder / "project.toml"
        file.write_text(PROJECT + more)
        return file

    return write
