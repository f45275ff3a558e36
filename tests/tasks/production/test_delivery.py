"""Notices reach their receivers: once, in the end, whatever happens on the way."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import update

from tasks.patience import Patience
from tasks.production.notice import USUAL, Links, Notice
from tasks.production.notice_addresses import NoticeAddress, configured_addresses
from tasks.production.outbox import PATIENCE, Courier, Outbox
from tasks.production.records import Records, write_notice
from tasks.production.tables import NOTICE_DELIVERIES, NOTICES
from tests.conftest import Start
from tests.ports import free_port
from tests.tasks.production.ended_runs import ended_run
from tests.tasks.production.receivers import mail_receiver, web_receiver

LINKS = Links("http://127.0.0.1:4200", "http://127.0.0.1:4201")
#: Pauses of no length: a test says itself when the next attempt is made.
AT_ONCE = Patience(0.0, 0.0, 3 * 86_400.0)


@pytest.fixture
def records(tmp_path: Path) -> Records:
    return Records.at(str(tmp_path / "records.sqlite"))


@pytest.fixture
def courier(records: Records) -> Callable[..., Courier]:
    def make(*urls: str, wanted: Any = USUAL, patience: Patience = AT_ONCE) -> Courier:
        # The slow digest of an address takes most of the time of many tests.
        if urls not in known:
            known[urls] = configured_addresses({"AEROCAL_NOTIFY": " ".join(urls)})
        addresses = known[urls]
        return Courier(Outbox(records), addresses, wanted, LINKS, said.append, patience)

    said, known = list[str](), dict[tuple[str, ...], tuple[NoticeAddress, ...]]()
    make.said = said  # type: ignore[attr-defined]
    return make


def test_a_failed_gate_arrives_at_a_webhook_once(records: Records, courier: Callable[..., Courier]) -> None:
    run = ended_run(records)
    with web_receiver() as web:
        assert courier(web.address).deliver() == 0
        assert courier(web.address).deliver() == 0
        (message,) = web.asked
    assert message["title"] == "GateFailed: block-7 (aerial-triangulation)"
    assert message["type"] == "warning"
    notice = message["notice"]
    assert (notice["kind"], notice["state"]) == ("gate", "GateFailed")
    assert notice["id"] == f"{run}:{notice['ended']}"
    assert notice["gates"][0]["limit"] == 1.2
    assert notice["problems"] == ["Too large."]
    assert notice["links"] == {
        "report": f"http://127.0.0.1:4201/results/{run}/report.html",
        "run": f"http://127.0.0.1:4200/v2/runs/flow-run/{run}",
    }
    assert "Not met: sigma0 = 1.5, limit <= 1.2" in message["message"]
    assert "- Too large." in message["message"]


def test_a_receiver_that_is_down_gets_the_notice_when_it_is_up(
    records: Records, courier: Callable[..., Courier]
) -> None:
    ended_run(records, "Failed", message="The disk is full.")
    port = free_port("127.0.0.1")
    away = courier(f"json://127.0.0.1:{port}/secret-token")
    assert [away.deliver(), away.deliver()] == [1, 1]
    assert len(courier.said) == 1  # type: ignore[attr-defined]
    assert "secret-token" not in courier.said[0]  # type: ignore[attr-defined]
    with web_receiver(port=port) as web:
        assert courier(web.address).deliver() == 0
        assert courier(web.address).deliver() == 0
        assert [one["notice"]["message"] for one in web.accepted] == ["The disk is full."]


def test_a_receiver_that_refuses_is_asked_again_until_it_accepts(
    records: Records, courier: Callable[..., Courier]
) -> None:
    ended_run(records)
    with web_receiver(answers=[500, 503]) as web:
        asking = courier(web.address)
        assert [asking.deliver() for _ in range(4)] == [1, 1, 0, 0]
        assert (len(web.asked), len(web.accepted)) == (3, 1)
    assert "refused with status 500" in courier.said[0]  # type: ignore[attr-defined]


def test_pauses_grow_and_a_notice_is_given_up_in_the_end(
    records: Records, courier: Callable[..., Courier]
) -> None:
    assert [PATIENCE.pause_s(n) for n in (1, 2, 3, 50)] == [10.0, 20.0, 40.0, 3600.0]
    ended_run(records)
    with web_receiver(answers=[500] * 9) as web:
        patient = courier(web.address, patience=Patience(3600.0, 3600.0, 3 * 86_400.0))
        assert [patient.deliver(), patient.deliver()] == [1, 1]
        assert len(web.asked) == 1, "it waits before it asks again"
    with web_receiver(answers=[500] * 9) as other:
        assert courier(other.address, patience=Patience(0.0, 0.0, 0.0)).deliver() == 0
        assert courier(other.address).deliver() == 0
        assert len(other.asked) == 1
    assert "dropped" in courier.said[-1]  # type: ignore[attr-defined]


def test_one_address_that_is_down_keeps_no_other_waiting(
    records: Records, courier: Callable[..., Courier]
) -> None:
    for number in range(2):
        ended_run(records, number=number)
    port = free_port("127.0.0.1")
    with web_receiver() as web:
        both = courier(f"json://127.0.0.1:{port}", web.address)
        assert [both.deliver(), both.deliver()] == [2, 2]
        assert len(web.accepted) == 2
        with web_receiver(port=port) as late:
            both = courier(f"json://127.0.0.1:{port}", web.address)
            assert both.deliver() == 0
            assert len(late.accepted) == 2
        assert len(web.asked) == 2


@pytest.mark.parametrize("count", [25, pytest.param(205, marks=pytest.mark.slow)])
def test_many_notices_for_an_address_that_is_down_keep_no_other_waiting(
    records: Records, courier: Callable[..., Courier], count: int
) -> None:
    with records.writing() as connection:
        for number in range(count):
            ended = datetime.now(UTC).isoformat()
            write_notice(
                connection, Notice(f"{number}", "failure", "", "block-7", "s", "Failed", "Full.", "", ended)
            )
    with web_receiver() as web:
        both = courier(f"json://127.0.0.1:{free_port('127.0.0.1')}", web.address)
        assert both.deliver() == count
        assert {one["notice"]["id"] for one in web.accepted} == {str(number) for number in range(count)}


def test_a_notice_with_a_gate_of_an_earlier_version_is_delivered(
    records: Records, courier: Callable[..., Courier]
) -> None:
    ended_run(records)
    (notice,) = Outbox(records).waiting()
    content = json.loads(notice.to_text())
    content["gates"].append({"name": "sigma0", "passed": False})
    with records.writing() as connection:
        connection.execute(update(NOTICES).values(content=json.dumps(content)))
    with web_receiver() as web:
        assert courier(web.address).deliver() == 0
        assert web.accepted[0]["notice"]["gates"] == notice.payload(LINKS)["gates"]


def test_a_clock_that_ran_ahead_delays_no_notice(records: Records, courier: Callable[..., Courier]) -> None:
    ended_run(records)
    with web_receiver(answers=[500]) as web:
        patient = courier(web.address, patience=Patience(0.0, 3600.0, 3 * 86_400.0))
        assert patient.deliver() == 1
        with records.writing() as connection:
            ahead = datetime.now(UTC) + timedelta(days=365)
            connection.execute(update(NOTICE_DELIVERIES).values(due=ahead))
        assert patient.deliver() == 0
        assert len(web.accepted) == 1


@pytest.mark.parametrize(
    ("state", "wanted", "number"),
    [
        ("InputError", USUAL, 1),
        ("NotComputable", USUAL, 1),
        ("Crashed", USUAL, 1),
        ("TimedOut", USUAL, 1),
        ("Cancelled", USUAL, 0),
        ("Completed", USUAL, 0),
        ("Completed", ("success",), 1),
        ("GateFailed", ("failure",), 0),
    ],
)
def test_only_what_is_wanted_is_told(
    state: str, wanted: Any, number: int, records: Records, courier: Callable[..., Courier]
) -> None:
    ended_run(records, state)
    with web_receiver() as web:
        assert courier(web.address, wanted=wanted).deliver() == 0
        # Nor is it told later, when more is wanted.
        assert courier(web.address, wanted=("gate", "failure", "success")).deliver() == 0
        assert len(web.asked) == number


def test_what_happened_while_nobody_was_to_be_told_is_not_told_later(
    records: Records, courier: Callable[..., Courier]
) -> None:
    ended_run(records)
    assert courier().deliver() == 0
    with web_receiver() as web:
        assert courier(web.address).deliver() == 0
        assert web.asked == []


def test_another_attempt_of_a_run_is_another_notice(
    records: Records, courier: Callable[..., Courier]
) -> None:
    with web_receiver() as web:
        for _ in range(2):
            ended_run(records, "Crashed")
            courier(web.address).deliver()
        assert len({one["notice"]["id"] for one in web.accepted}) == 2


def test_an_end_after_which_the_run_is_begun_again_is_told_when_it_is_the_last(
    records: Records, courier: Callable[..., Courier]
) -> None:
    run = ended_run(records, "Crashed")
    with web_receiver() as web:
        courier(web.address).deliver()
        told = len(web.accepted)
        found = records.run(run)
        assert found is not None
        records.begin(found)
        records.lose(run, "Crashed", "killed.")
        courier(web.address).deliver()
        assert len(web.accepted) == told
        records.give_up(run)
        courier(web.address).deliver()
        assert len(web.accepted) == told + 1


def test_a_letter_has_one_subject_whatever_the_project_is_called(
    records: Records, courier: Callable[..., Courier]
) -> None:
    ended_run(
        records, project="block\r\nBcc: other@example.org\r\n\r\nbody", message="<b>bold</b>\r\n.\r\nQUIT"
    )
    with mail_receiver() as mail:
        assert courier(mail.address).deliver() == 0
        (letter,) = mail.letters
    assert letter["Subject"] == "GateFailed: block Bcc: other@example.org body (aerial-triangulation)"
    assert letter["Bcc"] is None
    assert letter["To"] == "manager@example.org"
    assert letter.get_content_type() == "text/plain"
    assert "<b>bold</b> . QUIT" in letter.get_content()


_KILLED = """
    from tasks.production.notice_addresses import configured_addresses
    from tasks.production.notice import USUAL, Links
    from tasks.production.outbox import Courier, Outbox
    from tasks.production.records import Records
    outbox = Outbox(Records.at({records!r}))
    say = lambda sentence: print(sentence, flush=True)
    courier = Courier(outbox, configured_addresses(), USUAL, Links(), say)
    while True:
        courier.deliver()
"""


def test_a_notice_outlives_the_process_that_was_to_deliver_it(
    start: Start, records: Records, courier: Callable[..., Courier], tmp_path: Path
) -> None:
    port = free_port("127.0.0.1")
    url = f"json://127.0.0.1:{port}"
    program = textwrap.dedent(_KILLED.format(records=str(tmp_path / "records.sqlite")))
    for number in range(2):
        ended_run(records, number=number)
    environment = {**os.environ, "AEROCAL_NOTIFY": url}
    process = start(sys.executable, "-c", program, env=environment, stdout=subprocess.PIPE)
    assert process.stdout is not None
    assert "will be retried" in process.stdout.readline()
    process.send_signal(signal.SIGKILL)
    process.wait()
    with web_receiver(port=port) as web:
        deadline = time.monotonic() + 60
        while courier(url).deliver() and time.monotonic() < deadline:
            time.sleep(0.2)
        assert len({one["notice"]["id"] for one in web.accepted}) == 2
        assert len(web.accepted) == 2
