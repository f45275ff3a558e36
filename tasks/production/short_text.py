"""The short text that Prefect's dashboard shows of a run, with links to report and production page.

It fills a gap of Prefect's states, whose messages have no links. Everything else about a run is on the
production page, in one place. The dashboard renders Markdown and lets HTML through, so a name from a delivery
is written so that whatever has a meaning in either has none.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tasks.plain_text import visible

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


@dataclass(frozen=True)
class ShortText:
    """A run that has ended, as the dashboard shows it.

    Attributes
    ----------
    project, project_file, story : what was done to which project; the file tells two of one name apart.
    state, message : how it ended, and sentences on that.
    problems : plain sentences, the most serious first.
    place : where the results are; "": nowhere.
    links : words and addresses of ours, their parts percent-encoded.
    """

    project: str
    project_file: Path
    story: str
    state: str
    message: str
    problems: Sequence[str] = ()
    place: str = ""
    links: Sequence[tuple[str, str]] = ()

    @property
    def key(self) -> str:
        """The same for all runs of a story on a project: small letters, digits and dashes."""
        place = hashlib.sha256(str(self.project_file).encode(errors="surrogateescape")).hexdigest()[:8]
        name = re.sub(r"[^a-z0-9]+", "-", _one_line(self.project).lower()).strip("-")[:_SLUG].strip("-")
        return "-".join(part for part in (name, place, self.story) if part)

    @property
    def line(self) -> str:
        """State and message as one line of Markdown."""
        return inert(f"{self.state}: {self.message}")

    @property
    def markdown(self) -> str:
        """The text as Markdown."""
        links = [f"[{inert(words)}](<{address}>)" for words, address in self.links]
        problems = [f"- {inert(problem)}" for problem in self.problems[:_MOST_PROBLEMS]]
        more = len(self.problems) - len(problems)
        parts = [
            f"**{self.line}**",
            " · ".join((inert(f"Project {self.project}"), inert(self.story), *links)),
            "\n".join([*problems, *([f"- {more} more in summary.json."] if more > 0 else [])]),
            REMEDIES.get(self.state, ""),
            f"Folder: {code(self.place)}" if self.place else "",
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
