"""The file of the results and the table made of it."""

from __future__ import annotations

import io
import json
from pathlib import Path

from rich.console import Console

from benchmarks.record import Record, keep, read_records, show


def record(name: str, seconds: float = 1.0) -> Record:
    return Record(
        name=name,
        ours_s=seconds,
        ours_min_s=0.9,
        ours_max_s=1.1,
        peer_s=6.123456789,
        peer_min_s=6.0,
        peer_max_s=7.0,
        ratio=6.123456789 / seconds,
        runs=5,
        included="everything",
        machine="2 cores",
        images=2448,
        points=188_175,
        image_points=544_528,
        peak_memory_mib=553.2,
    )


def test_a_new_result_replaces_the_one_of_its_name_in_its_place(tmp_path: Path) -> None:
    file = tmp_path / "results.jsonl"
    keep([record("a"), record("b")], file)
    keep([record("a", 2.0), record("c")], file)
    assert [(item.name, item.ours_s) for item in read_records(file)] == [("a", 2.0), ("b", 1.0), ("c", 1.0)]


def test_every_line_has_the_fields_that_others_read(tmp_path: Path) -> None:
    keep([record("a")], tmp_path / "results.jsonl")
    (line,) = (tmp_path / "results.jsonl").read_text().splitlines()
    content = json.loads(line)
    assert content["peer_s"] == 6.1235
    assert {"name", "ours_s", "ratio", "images", "points", "image_points", "peak_memory_mib"} <= set(content)


def test_the_table_shows_median_and_spread() -> None:
    console = Console(file=io.StringIO(), width=120)
    grown = Record(
        "growth-500", 0.4, 0.4, 0.4, 1, "", "", phases_s={"accumulation": 0.02}, image_points=10**5
    )
    show([record("dmc2-230"), grown], console)
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    assert "1.00 (0.90 – 1.10)" in text
    assert "0.200" in text


def test_no_results_are_no_error(tmp_path: Path) -> None:
    assert read_records(tmp_path / "none.jsonl") == []
