"""A notice about a run that has ended."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, get_args
from urllib.parse import quote

from pydantic import OnErrorOmit, TypeAdapter

from tasks.errors import InputError
from tasks.nearest_name import did_you_mean
from tasks.plain_text import visible
from tasks.production.run_record import RunRecord
from tasks.results.quality_gates import GateResult

#: What a notice is about: a failed gate, a run without result, a calibration that is due, a run that is done.
NoticeKind: TypeAlias = Literal["gate", "failure", "recalibration", "success"]
#: What is told unless something else is required.
USUAL: tuple[NoticeKind, ...] = ("gate", "failure", "recalibration")

#: What a notice about a run is about, by its state; no notice about other states.
KINDS: Mapping[str, NoticeKind] = {
    "GateFailed": "gate",
    "InputError": "failure",
    "NotComputable": "failure",
    "Failed": "failure",
    "TimedOut": "failure",
    "Crashed": "failure",
    "RecalibrationDue": "recalibration",
    "Completed": "success",
}
#: The page about a run, by story.
_PAGES: Mapping[str, str] = {
    "direct-georeferencing-check": "georeferencing_check.html",
    "scenario-sweep": "sweep.html",
    "image-quality": "image_quality.html",
}
_LONGEST_SUBJECT = 200
_LONGEST_LINE = 2_000
_MOST_PROBLEMS = 20


@dataclass(frozen=True)
class Links:
    """Where readers find more: addresses of dashboard and production page; None if unknown."""

    dashboard: str | None = None
    overview: str | None = None


@dataclass(frozen=True)
class Notice:
    """A notice about a run that has ended.

    Attributes
    ----------
    id : the same however often it is sent; another attempt of a run has another one.
    kind : what it is about.
    run : number of the flow run.
    project, story, state, message : as of the run.
    directory : its output folder; "" without one.
    ended : ISO 8601, UTC.
    problems : plain sentences, the most serious first.
    sigma0 : of the adjustment; None without one.
    gates : of summary.json.
    """

    id: str
    kind: NoticeKind
    run: str
    project: str
    story: str
    state: str
    message: str
    directory: str
    ended: str
    problems: tuple[str, ...] = ()
    sigma0: float | None = None
    # A gate as an earlier version wrote it must not keep all notices waiting.
    gates: tuple[OnErrorOmit[GateResult], ...] = ()

    @property
    def subject(self) -> str:
        """The subject in one line, whatever the name of the project."""
        return _line(f"{self.state}: {self.project} ({self.story})")[:_LONGEST_SUBJECT]

    def text(self, links: Links) -> str:
        """The message as plain text."""
        parts = [self.message, *(_unmet(gate) for gate in self.gates if not gate.passed)]
        if self.sigma0 is not None:
            parts.append(f"sigma0 = {self.sigma0:.3f}")
        lines = [_line(part) for part in parts if part]
        if self.problems:
            shown = [f"- {_line(problem)}" for problem in self.problems[:_MOST_PROBLEMS]]
            more = len(self.problems) - len(shown)
            lines += ["", "Problems:", *shown, *([f"- {more} more in summary.json"] if more > 0 else [])]
        addresses = self.addresses(links)
        lines += ["", *(f"{name.capitalize()}: {address}" for name, address in addresses.items())]
        if self.directory:
            lines.append(f"Folder: {_line(self.directory)}")
        return "\n".join([*lines, f"Ended: {self.ended}"])

    def addresses(self, links: Links) -> dict[str, str]:
        """Address of the run in the dashboard, and of its report if it has one."""
        found = {}
        run = quote(self.run, safe="")
        if links.overview is not None and self.kind in ("gate", "success") and self.directory:
            found["report"] = report_address(links.overview, self.run, self.story)
        if links.dashboard is not None:
            found["run"] = f"{links.dashboard}/v2/runs/flow-run/{run}"
        return found

    def payload(self, links: Links) -> dict[str, Any]:
        """The notice for programs."""
        return {**_NOTICE.dump_python(self, mode="json"), "links": self.addresses(links)}

    def to_text(self) -> str:
        """For the outbox."""
        return _NOTICE.dump_json(self).decode()


_NOTICE = TypeAdapter(Notice)


def report_address(overview: str, run: str, story: str) -> str:
    """Where the production page at an address serves the page about a run."""
    return f"{overview}/results/{quote(run, safe='')}/{_PAGES.get(story, 'report.html')}"


def notice_from(text: str) -> Notice:
    """A notice from the text of `Notice.to_text`."""
    return _NOTICE.validate_json(text)


def notice_of_run(run: RunRecord) -> Notice | None:
    """The notice of a run that has ended; None if its state needs no notice (cancelled)."""
    kind = KINDS.get(run.state)
    if kind is None or run.ended is None:
        return None
    # A run that is started again ends another time, and that is told, too.
    ended = run.ended.isoformat(timespec="milliseconds")
    return Notice(
        f"{run.id}:{ended}",
        kind,
        run.id,
        run.project,
        run.story,
        run.state,
        run.message,
        run.directory,
        ended,
        # Without a result the only problem is the message.
        run.figures.problems if kind in ("gate", "success") else (),
        run.figures.sigma0,
        run.figures.gates,
    )


def wanted_kinds(text: str) -> frozenset[NoticeKind]:
    """The kinds in a text, separated by commas.

    Raises
    ------
    InputError
        If it names none, or something else.
    """
    kinds: tuple[NoticeKind, ...] = get_args(NoticeKind)
    names = [name.strip() for name in text.split(",") if name.strip()]
    for name in names:
        if name not in kinds:
            raise InputError(f"There are no notices of type '{visible(name)}'.", did_you_mean(name, kinds))
    if not names:
        raise InputError("--notify-on names nothing.", f"Write one or more of {', '.join(kinds)}.")
    return frozenset(kind for kind in kinds if kind in names)


def _unmet(gate: GateResult) -> str:
    """A limit that is not met."""
    sign, unit = ">=" if gate.bound == "min" else "<=", "" if gate.unit == "1" else f" {gate.unit}"
    value, limit = gate.words
    return f"Not met: {gate.name} = {value}{unit}, limit {sign} {limit}{unit}"


def _line(text: str) -> str:
    """A text in one line, because a line break ends a header of an e-mail."""
    return visible(" ".join(text.split()), _LONGEST_LINE)
