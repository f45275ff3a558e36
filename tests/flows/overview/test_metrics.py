"""What Prometheus reads: the figures of the records, for who may ask."""

from __future__ import annotations

from collections.abc import Callable

from flask.testing import FlaskClient
from prometheus_client.parser import text_string_to_metric_families

from flows.overview.sources import Sources
from flows.server.inbox import Scheduled
from tasks.production.records import Records
from tests.tasks.production.runs import ended, run

Browse = Callable[..., FlaskClient]


def figures(client: FlaskClient) -> dict[tuple[str, tuple[tuple[str, str], ...]], float]:
    """Value by name and labels of everything a scraper finds."""
    answer = client.get("/metrics")
    assert answer.status_code == 200
    assert answer.headers["Content-Type"].startswith("text/plain; version=0.0.4")
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(answer.get_data(as_text=True))
        for sample in family.samples
    }


def test_runs_are_counted_by_story_and_state(sources: Sources, browse: Browse, records: Records) -> None:
    client = browse(sources)
    before = figures(client)
    first, second, third = (run(f"project-{number}") for number in range(3))
    for one in (first, second, third):
        records.begin(one)
    ended(records, first)
    ended(records, second)
    now = figures(client)

    def grown(state: str) -> float:
        labels = (("state", state), ("story", first.story))
        return now[("aerocal_runs", labels)] - before.get(("aerocal_runs", labels), 0.0)

    assert (grown("Completed"), grown("Running")) == (2.0, 1.0)
    labels = (("state", "Completed"), ("story", first.story))
    found = records.run(second.id)
    assert found is not None
    assert found.ended is not None
    assert now[("aerocal_last_end_timestamp_seconds", labels)] >= found.ended.timestamp() - 1e-3


def test_server_queue_inbox_and_version_are_there(sources: Sources, browse: Browse) -> None:
    from dataclasses import replace
    from importlib.metadata import version

    news = Scheduled((), (), ("block-9", "block-10"), ("block-11 is not valid.",), ("block-7",))
    found = figures(browse(replace(sources, inbox=lambda: news)))
    assert found[("aerocal_info", (("version", version("aerocal")),))] == 1.0
    assert found[("aerocal_server_up", ())] in (0.0, 1.0)
    assert found[("aerocal_inbox_folders", (("state", "incomplete"),))] == 2.0
    assert found[("aerocal_inbox_folders", (("state", "refused"),))] == 1.0
    assert found[("aerocal_inbox_folders", (("state", "on_schedule"),))] == 1.0
    assert ("aerocal_notices_waiting", ()) in found
    assert found[("aerocal_queue_oldest_seconds", ())] >= 0.0


def test_who_has_no_password_gets_no_figures(sources: Sources, browse: Browse) -> None:
    answer = browse(sources, None).get("/metrics")
    assert answer.status_code == 401
    assert b"aerocal" not in answer.data.replace(b"aerocal_overview", b"")
