"""Numbers of the UltraCam Eagle example in the pages: ``python -m docs.generate.example_figures``.

Runs the example as its page says, with the data of ``AEROCAL_TEST_DATA``, keeps the figures next to the
example, and writes them into the sentences that state them. Tests hold the figures to a run, and the pages to
the figures.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "ign_ultracam_eagle"
FIGURES = EXAMPLE / "figures.json"
#: What is run: the value of ``adjustment.rejection`` for each.
RUNS = {"none": '"none"', "4.13": "{critical_value=4.13}", "3.29": "{critical_value=3.29}"}
#: Sentences that state figures, as they are in a page; a space may be a line end there.
SENTENCES = (
    (
        "examples/ign_ultracam_eagle/README.md",
        "{single_ray_points:,} points visible in only one image are ignored and counted; {images} images and "
        "{object_points:,} object points are adjusted with a redundancy of {redundancy:,}. Without rejection "
        "σ0 (a posteriori / a priori) is {sigma0_none:.3f}",
    ),
    (
        "examples/ign_ultracam_eagle/README.md",
        "{rejected_413} image points are rejected and σ0 is {sigma0_413:.3f}:",
    ),
    (
        "docs/theory/adjustment.md",
        "4.13 rejects {rejected_413} of the {image_points:,} image points of the UltraCam example, and σ0 "
        "decreases from {sigma0_none:.2f} to {sigma0_413:.2f}.",
    ),
    (
        "CHANGELOG.md",
        "4.13 rejects {rejected_413} image points of that block (σ0 {sigma0_413:.3f}), 3.29 rejects "
        "{rejected_329} ({sigma0_329:.3f}).",
    ),
    (
        "docs/status.md",
        "4.13: {rejected_413} image points, σ0 {sigma0_413:.3f}; 3.29: {rejected_329}, σ0 {sigma0_329:.3f};",
    ),
)


def figures_of(summaries: dict[str, Any]) -> dict[str, float]:
    """The figures that pages state, from ``summary.json`` of every run."""
    counts = summaries["none"]["counts"]
    found = {name: counts[name] for name in ("images", "object_points", "image_points", "single_ray_points")}
    found["redundancy"] = round(summaries["none"]["redundancy"])
    for name, summary in summaries.items():
        key = name.replace(".", "")
        found[f"sigma0_{key}"] = round(summary["sigma0"], 4)
        found[f"rejected_{key}"] = summary["counts"]["rejected_image_points"]
    return found


def with_figures(text: str, sentence: str, figures: dict[str, float]) -> str:
    """A page with the figures in one of its sentences.

    Raises
    ------
    ValueError
        If the page does not have the sentence once.
    """
    parts = re.split(r"(\{\w+:?[^}]*\})", sentence)
    pattern = "".join(
        r"(-?[\d.,]*\d)" if part.startswith("{") else re.escape(part).replace("\\ ", r"\s+") for part in parts
    )
    matches = list(re.finditer(pattern, text))
    if len(matches) != 1:
        raise ValueError(f"The page has this sentence {len(matches)} times, not once: {sentence}")
    (match,) = matches
    stated = [part.format(**figures) for part in parts if part.startswith("{")]
    for number in range(len(stated), 0, -1):
        text = text[: match.start(number)] + stated[number - 1] + text[match.end(number) :]
    return text


def write_figures(sentences: Iterable[tuple[str, str]], figures: dict[str, float]) -> None:
    """Write figures into sentences (page, sentence) of pages, each page named from the project's folder."""
    for page, sentence in sentences:
        path = ROOT / page
        path.write_text(with_figures(path.read_text(encoding="utf-8"), sentence, figures), encoding="utf-8")


def main() -> int:
    """Run the example, keep its figures, and write them into the pages."""
    summaries = {}
    for name, rejection in RUNS.items():
        with tempfile.TemporaryDirectory() as folder:
            request = RunRequest(
                EXAMPLE / "project.toml", Path(folder), overrides=(f"adjustment.rejection={rejection}",)
            )
            outcome = carry_out(aerial_triangulation, request)
            if outcome.error is not None:
                sys.exit(str(outcome.error))
            summaries[name] = json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
    figures = figures_of(summaries)
    FIGURES.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    write_figures(SENTENCES, figures)
    return 0


if __name__ == "__main__":
    sys.exit(main())
