"""What the production page answers, to whom, and with which protection."""

from __future__ import annotations

import base64
import gc
import json
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any
from urllib.request import Request, urlopen
from zoneinfo import ZoneInfo

import pytest
from flask.testing import FlaskClient

from flows.overview.application import page_server
from flows.overview.run_tables import queue_part
from flows.overview.sources import QueuedRun, ServerView, Sources
from flows.server.inbox import Scheduled
from tasks.production.notice import Links
from tasks.production.outbox import Outbox
from tasks.production.records import Records
from tests.flows.overview.conftest import DOOR
from tests.ports import free_port
from tests.tasks.production.runs import ended, run, summary
from tests.tasks.production.test_documents import REPORT, publish

Browse = Callable[..., FlaskClient]
HOSTILE = "<img src=x onerror=alert(1)> [x](javascript:alert(2))"


def basic(password: str) -> dict[str, str]:
    return {"Authorization": f"Basic {base64.b64encode(password.encode()).decode()}"}


def asked(client: FlaskClient, output: str, inputs: list[Any], state: list[Any]) -> Any:
    """The answer of a callback, asked as the page does."""
    listed = client.get("/_dash-dependencies").get_json()
    found = next(one for one in listed if output in one["output"])
    names = [part.rpartition(".") for part in found["output"].strip(".").split("...")]
    outputs = [{"id": name, "property": what} for name, _, what in names]
    body = {
        "output": found["output"],
        "outputs": outputs if found["output"].startswith("..") else outputs[0],
        "inputs": [{**one, "value": value} for one, value in zip(found["inputs"], inputs, strict=True)],
        "state": [{**one, "value": value} for one, value in zip(found["state"], state, strict=True)],
        "changedPropIds": [],
    }
    answer = client.post("/_dash-update-component", json=body)
    assert answer.status_code == 200, answer.get_data(as_text=True)
    return answer.get_json()["response"]


def refreshed(client: FlaskClient, revision: Any, ticks: int = 1) -> Any:
    return asked(client, "news.data", [ticks], [revision])


def texts(part: Any) -> str:
    """All texts of a part of the page."""
    if isinstance(part, dict):
        return texts(part.get("props", part).get("children", ""))
    return " ".join(map(texts, part)) if isinstance(part, list) else str(part or "")


def texts_of_rows(part: Any) -> list[str]:
    """The values in the rows of the grid, wherever it stands in the page."""
    if isinstance(part, list):
        return [text for one in part for text in texts_of_rows(one)]
    if not isinstance(part, dict):
        return []
    rows = part.get("rowData") or []
    return [value for row in rows for value in row.values() if isinstance(value, str)] + [
        text for one in part.values() for text in texts_of_rows(one)
    ]


def test_nothing_comes_from_elsewhere(sources: Sources, browse: Browse) -> None:
    page = browse(sources).get("/")
    text = page.get_data(as_text=True)
    for found in re.findall(r"""(?:src|href)=["']([^"']+)""", text):
        assert found.startswith("/"), found
    policy = page.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "http" not in policy
    assert "unsafe-eval" not in policy
    assert re.search(r"script-src 'self' 'sha256-[^']+'(;|$)", policy)
    assert page.headers["X-Content-Type-Options"] == "nosniff"
    assert page.headers["X-Frame-Options"] == "DENY"


def test_every_script_that_stands_in_the_page_is_allowed_by_its_digest(
    sources: Sources, browse: Browse
) -> None:
    import hashlib

    page = browse(sources).get("/")
    inline = re.findall(r"<script(?![^>]*src=)[^>]*>(.*?)</script>", page.get_data(as_text=True), re.S)
    run_by_the_browser = [script for script in inline if not script.lstrip().startswith("{")]
    assert run_by_the_browser
    for script in run_by_the_browser:
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        assert digest in page.headers["Content-Security-Policy"]


def test_who_has_no_password_sees_nothing(sources: Sources, browse: Browse, records: Records) -> None:
    one = publish(records, sources.roots.folders[0] / "block" / "results")
    client = browse(sources, None)
    pages = ("/", "/_dash-layout", f"/results/{one.id}/report.html", "/assets/grid.js", "/health")
    for headers in ({}, basic("ann:wrong"), basic("ann:"), basic(""), {"Authorization": "Bearer x"}):
        for page in pages:
            answer = client.get(page, headers=headers)
            assert answer.status_code == 401, page
            assert b"block" not in answer.data
    for page in pages:
        assert client.get(page, headers=basic("ann:secret"), buffered=True).status_code == 200, page


def test_a_page_for_this_machine_is_not_found_under_another_name(sources: Sources, browse: Browse) -> None:
    client = browse(sources)
    for host in ("localhost:4201", "127.0.0.1:4201", "[::1]:4201", "office:4201", "OFFICE."):
        assert client.get("/health", headers={"Host": host}).status_code == 200, host
    for host in ("evil.example:4201", "localhost.evil.example", "127.0.0.1.nip.example", ""):
        assert client.get("/health", headers={"Host": host}).status_code == 400, host


def test_the_link_makes_a_browser_known_to_this_page(sources: Sources, browse: Browse) -> None:
    client = browse(sources, None)
    page = client.get("/", headers={"Accept": "text/html"})
    assert page.status_code == 401
    assert b"not known yet" in page.data
    assert client.post("/enter", json={"key": "wrong"}).status_code == 403
    assert client.post("/enter", json={"key": sources.door.key}).status_code == 204
    assert client.get("/").status_code == 200
    foreign = client.get("/_dash-layout", headers={"Origin": "http://evil.example"})
    assert foreign.status_code == 403
    assert client.post("/_dash-update-component", data="{}").status_code == 415


def test_a_report_is_shown_without_scripts_and_apart_from_the_page(
    sources: Sources, browse: Browse, records: Records
) -> None:
    one = publish(records, sources.roots.folders[0] / "block" / "results")
    shown = browse(sources).get(f"/results/{one.id}/report.html")
    assert (shown.status_code, shown.data, shown.mimetype) == (200, REPORT, "text/html")
    policy = shown.headers["Content-Security-Policy"]
    assert "sandbox" in policy
    assert "script" not in policy.replace("allow-scripts", "script")
    assert shown.headers["Cache-Control"] == "no-store"


def test_a_changed_report_is_refused_in_words(sources: Sources, browse: Browse, records: Records) -> None:
    folder = sources.roots.folders[0] / "block" / "results"
    one = publish(records, folder)
    (folder / "report.html").write_bytes(b"<script>alert(1)</script>")
    answer = browse(sources).get(f"/results/{one.id}/report.html")
    assert answer.status_code == 410
    assert b"was changed after the run" in answer.data
    assert b"alert(1)" not in answer.data


@pytest.mark.parametrize(
    "path",
    [
        "/results", "/results/", "/results/{run}", "/results/{run}/", "/results/{run}/secret.html",
        "/results/{run}/../../../records.sqlite", "/results/{run}/..%2f..%2fproject.toml",
        "/results/{run}/%2e%2e", "/results/..%2f..%2fstate/records.sqlite", "/results/{run}/images.parquet",
        "/results/%27%20OR%201=1/report.html", "/assets/../application.py", "/assets/%2e%2e/application.py",
        "/_dash-component-suites/dash/../../os.py",
    ],
)  # fmt: skip
def test_no_other_path_leads_to_a_file(sources: Sources, browse: Browse, records: Records, path: str) -> None:
    one = publish(records, sources.roots.folders[0] / "block" / "results")
    client = browse(sources)
    answer = client.get(path.format(run=one.id))
    assert answer.status_code in ((404,) if path.startswith("/results") else (404, 500, 200))
    for secret in (b"SQLite format", b"not of the run", b"PAR1", b"def application", b"report.html\n"):
        assert secret not in answer.data


def test_a_refusal_shows_hostile_names_as_text(sources: Sources, browse: Browse, records: Records) -> None:
    one = ended(records, run(HOSTILE, directory="/nowhere"), "InputError", HOSTILE)
    answer = browse(sources).get(f"/results/{one.id}/report.html")
    assert answer.status_code == 404
    assert b"<img" not in answer.data
    assert b"&lt;img" in answer.data


def test_hostile_names_reach_the_browser_as_plain_values(
    sources: Sources, browse: Browse, records: Records
) -> None:
    """Cells are drawn by React from values; over a plot, where marks count, they are escaped."""
    figures = {**summary(1.4), "problems": [HOSTILE]}
    one = ended(records, run(HOSTILE), "GateFailed", HOSTILE, figures=figures)
    client = browse(sources)
    layout = client.get("/_dash-layout").get_data(as_text=True)
    assert "<img" not in layout
    assert HOSTILE in texts_of_rows(json.loads(layout))
    assert '"dangerously_allow_code":false' in layout.replace(" ", "")
    assert "dangerously_allow_html" not in layout
    trend = json.dumps(asked(client, "sigma0-trend.children", [None], []))
    assert "&lt;img src=x" in trend
    hovered = json.loads(trend)["sigma0-trend"]["children"]["props"]["figure"]["data"]
    assert all("<img" not in str(trace.get("customdata")) for trace in hovered)
    links = re.findall(r'"href": "([^"]+)"', trend)
    detail = json.dumps(asked(client, "detail.children", [[{"run": one.id}]], []))
    for link in links + re.findall(r'"href": "([^"]+)"', detail):
        assert link.startswith(("http://127.0.0.1:4200/v2/runs/flow-run/", "/results/")), link


def test_the_page_asks_for_what_is_new_only(sources: Sources, browse: Browse, records: Records) -> None:
    for number in range(3):
        ended(records, run(f"block-{number}"))
    client = browse(sources)
    first = refreshed(client, {"board": "", "number": 0})
    assert first["news"]["data"]["whole"]
    assert len(first["news"]["data"]["rows"]) == 3
    assert first["no-projects"]["children"] is None
    again = refreshed(client, first["revision"]["data"])
    assert "news" not in again
    assert "revision" not in again
    ended(records, run("block-1", hours=1), "GateFailed", figures=summary(1.4))
    news = refreshed(client, first["revision"]["data"])
    told = news["news"]["data"]
    assert [row["state"] for row in told["rows"]] == ["GateFailed"]
    assert (told["whole"], told["removed"]) == (False, [])


def test_an_empty_page_says_how_to_begin(sources: Sources, browse: Browse) -> None:
    client = browse(sources)
    first = refreshed(client, {"board": "", "number": 0})
    assert "No project has been run yet" in texts(first["no-projects"]["children"])
    assert "DOES NOT ANSWER" in texts(first["said"]["children"])
    assert "No run has failed" in texts(
        asked(client, "failures.children", [None], [])["failures"]["children"]
    )
    due = asked(client, "due.children", [None], [None])["due"]["children"]
    assert "aerocal serve --registry" in texts(due)


def test_cards_count_every_state_once(sources: Sources, browse: Browse, records: Records) -> None:
    states = ("Completed", "GateFailed", "InputError", "NotComputable", "Failed", "Crashed", "Cancelled")
    for state in states:
        ended(records, run(state), state)  # type: ignore[arg-type]
    records.begin(run("at-work"))
    now = datetime.now(UTC)
    for hours in (3, 50, 2):
        records.schedule(replace(run(f"waits-{hours}"), scheduled=now - timedelta(hours=hours)))
    cards = refreshed(browse(sources), {"board": "", "number": 0})["cards"]["children"]
    assert [texts(card).split(" ", 1) for card in cards] == [
        ["1", "passed"],
        ["1", "gate failed"],
        ["2", "wrong input"],
        ["3", "failed"],
        ["1", "running"],
        ["3", "waiting, the longest for 2\xa0d"],
    ]


def test_failures_say_whether_the_project_has_passed_since(
    sources: Sources, browse: Browse, records: Records
) -> None:
    ended(records, run("block-1"), "InputError", "exposures.csv is not there.")
    ended(records, run("block-2"), "InputError", "control.csv is not there.")
    ended(records, run("block-1", hours=1))
    ended(records, run("block-3"))
    # It was requested before the one that passed, and has waited for longer.
    ended(records, run("block-3", hours=-1), "NotComputable", "No convergence.")
    client = browse(sources)
    refreshed(client, {"board": "", "number": 0})
    told = texts(asked(client, "failures.children", [None], [])["failures"]["children"])
    assert "exposures.csv is not there. A later run has passed." in told
    assert "control.csv is not there." in told
    assert "No convergence." in told
    assert told.count("A later run has passed.") == 1


@pytest.fixture
def far_west(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A server in another time zone than UTC."""
    monkeypatch.setenv("TZ", "America/Denver")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


@pytest.mark.usefixtures("far_west")
def test_times_are_those_of_the_zone_of_the_schedules_which_is_named(
    sources: Sources, browse: Browse, records: Records
) -> None:
    first, second = ended(records, run("block-1")), ended(records, run("block-1", hours=1))
    zone = ZoneInfo("Asia/Kolkata")
    client = browse(replace(sources, zone=zone))
    assert second.ended is not None
    there = second.ended.astimezone(zone)
    refreshed_page = refreshed(client, {"board": "", "number": 0})
    assert re.search(r"refreshed \d\d:\d\d:\d\d IST$", texts(refreshed_page["said"]["children"]))
    assert refreshed_page["news"]["data"]["rows"][0]["changed"] == there.isoformat(timespec="seconds")
    detail = texts(asked(client, "detail.children", [[{"run": second.id}]], [])["detail"]["children"])
    assert f"{first.scheduled.astimezone(zone):%Y-%m-%d %H:%M} IST" in detail
    drawn = json.dumps(asked(client, "sigma0-trend.children", [None], []))
    assert f'"x": ["{there:%Y-%m-%dT%H:%M:%S}"]' in drawn
    due = QueuedRun("1", "inbox", "Scheduled", datetime(2026, 7, 1, 7, 30, tzinfo=UTC), None)
    now = datetime(2026, 7, 1, tzinfo=UTC).astimezone(zone)
    queue = str(queue_part(ServerView(True, (), due), None, now, ""))
    assert "Wed 01 Jul 13:00 IST (in 8\\xa0h)" in queue


def test_what_the_inbox_holds_back_is_told(sources: Sources, browse: Browse) -> None:
    news = Scheduled((), (), ("block-9",), ("block-8 was not started. It has no project.toml.",))
    told = texts(
        refreshed(browse(replace(sources, inbox=lambda: news)), {"board": "", "number": 0})["queue"][
            "children"
        ]
    )
    assert "block-8 was not started. It has no project.toml." in told
    assert "not complete yet (no file DELIVERED, or still changing): block-9" in told


def test_complete_deliveries_that_wait_for_the_schedule_are_told_with_their_time() -> None:
    names = ", ".join(f"block-{number}" for number in range(25))
    news = Scheduled((), (), (), (), on_schedule=(*names.split(", "), "block-25", "block-26"))
    now = datetime(2026, 7, 1, tzinfo=UTC)
    queue = {
        search: str(queue_part(ServerView(True, (), None, search=search), news, now, ""))
        for search in (None, now - timedelta(hours=1), now + timedelta(hours=8))
    }
    told = f"wait for the schedule: {names} and 2 more. "
    assert f"{told}They start at " in queue[now + timedelta(hours=8)]
    assert "(in 8\\xa0h)." in queue[now + timedelta(hours=8)]
    assert f"{told}It is their turn now." in queue[now - timedelta(hours=1)]
    assert f"{told}No time is known: see the schedule of inbox/nightly in Prefect." in queue[None]


def test_the_queue_of_the_records_is_in_the_order_of_turns(sources: Sources, records: Records) -> None:
    """They stand in for a server that does not answer."""
    first, second, third, again = (run(f"project-{number}", float(number)) for number in range(4))
    for one in (second, first, third):
        records.schedule(one)
    for one in (third, again):
        records.begin(one)
    records.reschedule(again.id, "It was terminated by the machine.")
    queue = sources.server().queue
    assert [one.run for one in queue] == [third.id, first.id, second.id, again.id]
    assert [one.begun is None for one in queue] == [False, True, True, True]


def test_records_that_cannot_be_read_are_said_and_the_page_stays(
    sources: Sources, browse: Browse, records: Records
) -> None:
    client = browse(sources)
    file = records.address.file
    assert file is not None
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("no database")
    answer = refreshed(client, {"board": "", "number": 0})
    assert "This is not a SQLite database" in texts(answer["trouble"]["children"])
    assert client.get("/_dash-layout").status_code == 200


def test_a_selected_project_tells_its_gates_problems_and_older_runs(
    sources: Sources, browse: Browse, records: Records
) -> None:
    ended(records, run("block"), "InputError", "exposures.csv is not there.")
    publish(records, sources.roots.folders[0] / "block" / "results")
    figures = summary(1.4, problems=("Strip 3 contradicts its neighbours.",))
    one = ended(records, run("block", hours=2), "GateFailed", figures=figures)
    client = browse(sources)
    told = texts(asked(client, "detail.children", [[{"run": one.id}]], [])["detail"]["children"])
    for text in ("Strip 3 contradicts", "sigma0", "≤ 1.2", "▲ not passed", "exposures.csv is not there."):
        assert text in told
    assert asked(client, "detail.children", [[{"run": "unknown"}]], [])["detail"]["children"] is None


def test_a_gate_missed_by_little_shows_a_value_beyond_its_limit(
    sources: Sources, browse: Browse, records: Records
) -> None:
    run_id = ended(records, run("block-7"), "GateFailed", figures=summary(1.20004)).id
    told = json.dumps(asked(browse(sources), "detail.children", [[{"run": run_id}]], []), ensure_ascii=False)
    assert '"1.20004 ' in told
    (notice,) = Outbox(records).waiting()
    assert "Not met: sigma0 = 1.20004, limit <= 1.2" in notice.text(Links())


@pytest.mark.parametrize(
    "state", ["InputError", "NotComputable", "GateFailed", "Failed", "Crashed", "TimedOut"]
)
def test_what_to_do_about_a_run_that_did_not_pass_is_told(
    sources: Sources, browse: Browse, records: Records, state: Any
) -> None:
    run_id = ended(records, run("block-7"), state, "A sentence.").id
    assert "What to do" in json.dumps(asked(browse(sources), "detail.children", [[{"run": run_id}]], []))


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_a_page_ends_without_a_fault_while_visitors_come_and_go(sources: Sources, host: str) -> None:
    """A fault of a thread fails the test."""
    for _ in range(5):
        port = free_port("127.0.0.1")
        with page_server(sources, host, port):
            visitors = [socket.create_connection(("127.0.0.1", port)) for _ in range(40)]
            for visitor in visitors:
                visitor.sendall(b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n")
            threading.Thread(target=_hang_up, args=[visitors]).start()
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", port))


@pytest.mark.parametrize("declared", [True, False])
def test_a_stranger_cannot_fill_the_disk(sources: Sources, declared: bool) -> None:
    """What is sent is kept in a file until the whole of it has come."""
    port, sent = free_port("127.0.0.1"), 0
    with page_server(sources, "127.0.0.1", port), socket.create_connection(("127.0.0.1", port)) as stranger:
        length = "Content-Length: 30000000" if declared else "Transfer-Encoding: chunked"
        stranger.sendall(f"POST /enter HTTP/1.1\r\nHost: localhost\r\n{length}\r\n\r\n".encode())
        piece = b"x" * 60_000 if declared else b"ea60\r\n" + b"x" * 60_000 + b"\r\n"
        # The server hangs up in between.
        with suppress(ConnectionError):
            for _ in range(500):
                stranger.sendall(piece)
                sent += len(piece)
    assert sent < 25_000_000


def test_a_page_ends_without_a_fault_while_a_large_answer_waits_for_its_visitor(sources: Sources) -> None:
    """A file that is left open fails the test."""
    port, secret = free_port("127.0.0.1"), basic(DOOR.password)["Authorization"]
    with page_server(sources, "127.0.0.1", port):
        address = f"http://127.0.0.1:{port}"
        with urlopen(Request(address, headers={"Authorization": secret})) as answer:
            scripts = re.findall(r'src="(/_dash-component-suites/[^"]*)"', answer.read().decode())
        visitors = []
        for script in scripts:
            visitor = socket.create_connection(("127.0.0.1", port))
            visitor.sendall(
                f"GET {script} HTTP/1.1\r\nHost: localhost\r\nAuthorization: {secret}\r\n\r\n".encode()
            )
            assert visitor.recv(15) == b"HTTP/1.1 200 OK"
            visitors.append(visitor)
    gc.collect()
    _hang_up(visitors)


def _hang_up(visitors: list[socket.socket]) -> None:
    for visitor in visitors:
        visitor.close()
