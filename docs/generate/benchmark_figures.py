"""Times and memory in the pages: ``python -m docs.generate.benchmark_figures``.

Writes the figures of ``benchmarks/results.jsonl``, which ``make bench`` and ``make bench-large`` keep, into
the sentences that state them. Times depend on the machine, so they are measured by hand; tests hold the pages
to what was measured.
"""

from __future__ import annotations

import json
import sys

from docs.generate.example_figures import ROOT, write_figures

RESULTS = ROOT / "benchmarks" / "results.jsonl"
_OPERATIONAL = "2,448 images"
#: Sentences that state figures, as they are in a page; a space may be a line end there.
SENTENCES = (
    (
        "README.md",
        f"{_OPERATIONAL}, {{dmc2_230_points:,.0f}} points, {{dmc2_230_image_points:,.0f}} image points",
    ),
    (
        "README.md",
        "| adjusted values | {dmc2_230_ours_s:.2f} s | {dmc2_230_peer_s:.2f} s | {dmc2_230_ratio:.1f} | "
        "{dmc2_230_peak_memory_mib:.0f} against {dmc2_230_peer_peak_memory_mib:.0f} MiB |",
    ),
    (
        "README.md",
        "and all redundancy numbers | {dmc2_230_statistics_ours_s:.2f} s | "
        "{dmc2_230_statistics_peer_s:.2f} s | {dmc2_230_statistics_ratio:.1f} | "
        "{dmc2_230_statistics_peak_memory_mib:.0f} against "
        "{dmc2_230_statistics_peer_peak_memory_mib:.0f} MiB |",
    ),
    (
        "README.md",
        "and COLMAP with the covariances of all orientations | {dmc2_230_covariances_ours_s:.2f} s | "
        "{dmc2_230_covariances_peer_s:.2f} s | {dmc2_230_covariances_ratio:.1f} | "
        "{dmc2_230_covariances_peak_memory_mib:.0f} against "
        "{dmc2_230_covariances_peer_peak_memory_mib:.0f} MiB |",
    ),
    (
        "README.md",
        "A block of 50,000 images with {growth_50000_image_points_millions:.1f} million image points takes "
        "{growth_50000_processor_s:.0f} s of processor time and {growth_50000_peak_memory_gib:.1f} GiB of "
        "memory",
    ),
    (
        "CHANGELOG.md",
        "image points is adjusted in {dmc2_230_ours_s:.1f} s on two cores, with all covariances and "
        "redundancy numbers in {dmc2_230_statistics_ours_s:.1f} s (COLMAP, without statistics: "
        "{dmc2_230_peer_s:.1f} s); 50,000 images and {growth_50000_image_points_millions:.1f} million image "
        "points, with all statistics and their tables, in {growth_50000_processor_s:.0f} s of "
        "processor time and {growth_50000_peak_memory_gib:.1f} GiB.",
    ),
    (
        "CHANGELOG.md",
        f"The trust map of a million cells over {_OPERATIONAL} takes {{trust_map_2448_ours_s:.1f}} s",
    ),
    ("CHANGELOG.md", f"A million cells over {_OPERATIONAL} take {{trust_map_2448_ours_s:.1f}} s"),
    (
        "docs/status.md",
        "in row groups: {growth_50000_peak_memory_gib:.1f} GiB; per image point",
    ),
    (
        "docs/status.md",
        "{rig_200_image_points:,.0f} image points: {rig_200_ours_s:.2f} s of processor time for the "
        "adjustment with its statistics, {rig_200_ratio:.2f} times that of the same pictures as single "
        "cameras ({rig_200_peer_s:.2f} s)",
    ),
    (
        "docs/status.md",
        "2,000 events, {rig_2000_image_points:,.0f} image points (41 rays an object point): "
        "{rig_2000_ours_s:.1f} s,",
    ),
)


def figures() -> dict[str, float]:
    """Every number that was measured, as ``BENCHMARK_QUANTITY``; memory also in GiB, points in millions."""
    found: dict[str, float] = {}
    for line in RESULTS.read_text(encoding="utf-8").splitlines():
        measured = json.loads(line)
        name = measured["name"].replace("-", "_")
        found |= {f"{name}_{key}": value for key, value in measured.items() if isinstance(value, int | float)}
        for key, more, unit in (("peak_memory_mib", "peak_memory_gib", 1024), ("image_points", "", 1e6)):
            if isinstance(measured[key], int | float):
                found[f"{name}_{more or key + '_millions'}"] = measured[key] / unit
    return found


def main() -> int:
    """Write the figures into the pages."""
    measured = figures()
    write_figures(SENTENCES, measured)
    return 0


if __name__ == "__main__":
    sys.exit(main())
