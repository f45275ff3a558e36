"""Figures of the production for Prometheus: ``/metrics`` on the port of the production page.

They are counted from the records when they are requested, so that they survive a restart and are the same on
every machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from importlib.metadata import version

from flask import Flask, Response
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import GaugeMetricFamily, InfoMetricFamily, Metric
from prometheus_client.registry import Collector

from flows.overview.sources import ServerView, Sources
from tasks.errors import AerocalError
from tasks.production.outbox import Outbox

_MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"


def add_metrics(server: Flask, sources: Sources) -> None:
    """Add ``/metrics`` to a server; the door controls access to it, as to every page."""
    registry = CollectorRegistry()
    registry.register(ProductionFigures(sources))

    @server.get("/metrics")
    def _metrics() -> Response:
        try:
            return Response(generate_latest(registry), content_type=_MEDIA_TYPE)
        except AerocalError as error:
            return Response(str(error), 503, mimetype="text/plain")


class ProductionFigures(Collector):
    """Everything that is counted."""

    def __init__(self, sources: Sources) -> None:
        self.sources = sources

    def collect(self) -> Iterator[Metric]:
        """The figures of this moment."""
        now = datetime.now(UTC)
        yield InfoMetricFamily("aerocal", "Version of aerocal.", value={"version": version("aerocal")})
        yield from self._of_runs()
        yield from _of_server(self.sources.server(), now)
        waiting = len(Outbox(self.sources.records).waiting())
        yield GaugeMetricFamily("aerocal_notices_waiting", "Notices that are not delivered yet.", waiting)
        watch = self.sources.calibrations().watch
        if watch is not None:
            due = len(watch.due)
            yield GaugeMetricFamily("aerocal_calibrations_due", "Cameras whose calibration is due.", due)
        inbox = self.sources.inbox()
        if inbox is not None:
            folders = GaugeMetricFamily(
                "aerocal_inbox_folders", "Deliveries that have not started.", labels=["state"]
            )
            folders.add_metric(["incomplete"], len(inbox.waiting))
            folders.add_metric(["refused"], len(inbox.refused))
            folders.add_metric(["on_schedule"], len(inbox.on_schedule))
            yield folders

    def _of_runs(self) -> Iterator[Metric]:
        runs = GaugeMetricFamily("aerocal_runs", "Runs recorded.", labels=["story", "state"])
        ended = GaugeMetricFamily(
            "aerocal_last_end_timestamp_seconds",
            "Time at which the latest run of a story ended in a state.",
            labels=["story", "state"],
        )
        for story, state, number, last in self.sources.records.tally():
            runs.add_metric([story, state], number)
            if last is not None:
                ended.add_metric([story, state], last.timestamp())
        yield runs
        yield ended


def _of_server(view: ServerView, now: datetime) -> Iterator[Metric]:
    yield GaugeMetricFamily("aerocal_server_up", "Whether the server of runs answers.", view.reachable)
    queue = GaugeMetricFamily(
        "aerocal_queue_runs", "Runs in progress, and runs due to start.", labels=["state"]
    )
    states = [run.state for run in view.queue]
    for state in sorted({*states, "Running"}):
        queue.add_metric([state], states.count(state))
    queue.add_metric(["further"], view.more)
    yield queue
    since = [start for run in view.queue if (start := run.waiting_since(now)) is not None]
    longest = max(((now - start).total_seconds() for start in since), default=0.0)
    yield GaugeMetricFamily(
        "aerocal_queue_oldest_seconds", "Waiting time of the run that has waited longest.", longest
    )
