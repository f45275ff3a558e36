"""The short text that Prefect's dashboard shows of a run, with links to report and production page.

It fills a gap of Prefect's states, whose messages have no links. Everything else about a run is on the
production page, in one place. The dashboard renders Markdown and lets HTML through, so a name from a delivery
is written so that whatever has a meaning in either has none.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping

from tasks.plain_text import visible
from tasks.production.notice import report_address
from tasks.production.run_record import PUBLISHING, RunRecord

#: What to do about a state; shown here and on the production page.
REMEDIES: Mapping[str, str] = {
    "InputError": "Correct what the message names, then run again. A delivery is processed again when its "
    "file DELIVERED is rewritten. Earlier results were not changed.",
    "NotComputable": "Deliver more observations, or free fewer parameters (the message names them), then run "
    "again. Earlier results were not changed.",
    "GateFailed": "Read the problems and the report. The results are available; decide whether they may "
    "be used. Running again gives the same result.",
    "Failed": "The cause is the machine or aerocal, not the delivery: see message and log of the run. "
    "Run again when this is corrected; completed stages are reused.",
    "Crashed": "Nothing if it is restarted, see the message. Otherwise Retry in the dashboard, with more "
    "memory if that was full; completed stages are reused.",
    "TimedOut": "Retry in the dashboard: completed stages are reused.",
}
_MOST_PROBLEMS = 5
_SLUG = 40
# An underscore between letters, as names have them, means nothing.
_SPECIAL = re.compile(r"[\\`*{}\[\]#|~$]|(?<![^\W_])_|_(?![^\W_])|:(?=//)")
# What begins a list, a heading or a rule if it stands first.
_FIRST = re.compile(r"^([-+=]|\d+(?=[.)](?:\s|$)))")
_HTML = {ord("&"): "&amp;", ord("<"): "&lt;", ord(">"): "&gt;"}


def text_key(run: RunRecord) -> str:
    """The same for all runs of a story on a project: small letters, digits and dashes."""
    # The file tells two projects of one name apart.
    place = hashlib.sha256((run.project_file or run.project).encode(errors="surrogateescape")).hexdigest()[:8]
    name = re.sub(r"[^a-z0-9]+", "-", _one_line(run.project).lower()).strip("-")[:_SLUG].strip("-")
    return "-".join(part for part in (name, place, run.story) if part)


def text_line(run: RunRecord) -> str:
    """State and message as one line of Markdown."""
    return inert(f"{run.state}: {run.message}")


def text_of(run: RunRecord, overview: str | None) -> str:
    """The text as Markdown.

    Parameters
    ----------
    overview : address of the production page that shows the run; None: there is none.
    """
    links = []
    if overview is not None and run.state in PUBLISHING:
        links.append(f"[Report](<{report_address(overview, run.id, run.story)}>)")
    if overview is not None:
        links.append(f"[Production page](<{overview}/>)")
    said = run.figures.problems
    problems = [f"- {inert(problem)}" for problem in said[:_MOST_PROBLEMS]]
    more = len(said) - len(problems)
    parts = [
        f"**{text_line(run)}**",
        " · ".join((inert(f"Project {run.project}"), inert(run.story), *links)),
        "\n".join([*problems, *([f"- {more} more in summary.json."] if more > 0 else [])]),
        REMEDIES.get(run.state, ""),
        f"Folder: {code(run.directory)}" if run.directory else "",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def inert(text: str) -> str:
    """A text as inert Markdown in one line."""
    escaped = _SPECIAL.sub(r"\\\g<0>", _one_line(text)).translate(_HTML)
    # A digit cannot be escaped; the point behind it can.
    return _FIRST.sub(lambda found: f"{found[0]}\\" if found[0].isdigit() else f"\\{found[0]}", escaped)


def code(text: str) -> str:
    """A path as a piece of code; not for the cells of a table."""
    line = _one_line(text)
    longest = max((len(run) for run in re.findall("`+", line)), default=0)
    fence = "`" * (longest + 1)
    space = " " if longest else ""
    return f"{fence}{space}{line}{space}{fence}"


def _one_line(text: str) -> str:
    """A text without line breaks and invisible characters."""
    return visible(" ".join(text.split()))
