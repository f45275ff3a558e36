"""The artifacts of a run: what they hold and by what key the dashboard finds their history."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass
from typing import Literal

from tasks.dashboard.markdown import in_one_line, inert, link
from tasks.dashboard.points import point_table
from tasks.dashboard.run import EndedRun
from tasks.dashboard.verdict import page_links, verdict_line, verdict_markdown

#: Maps by their names in the manifest, the one that is shown first.
_MAPS = ("georeferencing_map", "map")
_SLUG = 40


@dataclass(frozen=True)
class DashboardArtifact:
    """Something the dashboard shows.

    Attributes
    ----------
    key : the same for all runs of a story on a project: small letters, digits and dashes.
    type : one the dashboard knows.
    description : a sentence, Markdown.
    data : as its type wants it.
    """

    key: str
    type: Literal["markdown", "table", "image"]
    description: str
    data: str


def dashboard_artifacts(run: EndedRun) -> tuple[DashboardArtifact, ...]:
    """Everything the dashboard shows about a run, the verdict first."""
    key = project_key(run)
    line = inert(verdict_line(run))
    made = [DashboardArtifact(f"{key}-verdict", "markdown", line, verdict_markdown(run))]
    points = point_table(run)
    if points is not None:
        words, rows = points
        made.append(
            DashboardArtifact(f"{key}-check-points", "table", words, json.dumps(rows, ensure_ascii=False))
        )
    shown = next((run.published[name] for name in _MAPS if name in run.published), None)
    address = None if shown is None else run.address(shown)
    if address is not None:
        words = "Exposures, control and check points with their differences, computed − given."
        made.append(DashboardArtifact(f"{key}-map", "image", words, address))
    links = page_links(run)
    if links:
        (words, address), *_ = links
        made.append(DashboardArtifact(f"{key}-report", "markdown", f"Link: {words}.", link(words, address)))
    return tuple(made)


def project_key(run: EndedRun) -> str:
    """What tells the artifacts of a project and a story from all others.

    The name of the project is there for people; the digest of its place keeps two of the same name apart.
    """
    place = hashlib.sha256(str(run.project_file).encode(errors="surrogateescape")).hexdigest()[:8]
    name = re.sub(r"[^a-z0-9]+", "-", in_one_line(run.project).lower()).strip("-")[:_SLUG].strip("-")
    return "-".join(part for part in (name, place, run.story) if part)
