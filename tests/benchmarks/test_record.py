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


def test_larger_blocks_are_measured_by_the_time_the_operational_one_takes_for_an_image_point() -> None:
    console = Console(file=io.StringIO(), width=120)

    def grown(seconds: float, images: int, image_points: int) -> Record:
        return Record(
            name=f"growth-{images}",
            ours_s=seconds,
            ours_min_s=seconds,
            ours_max_s=seconds,
            runs=1,
            included="",
            machine="",
            images=images,
            image_points=image_points,
            phases_s={"tables": 1.0},
            processor_s=2.0 * seconds,
            tables_mib=70.4,
        )

    show([grown(60.0, 50_000, 10**7), grown(2.0, 2_448, 5 * 10**5)], console)
    assert isinstance(console.file, io.StringIO)
    lines = console.file.getvalue().splitlines()

    def cells(name: str) -> list[str]:
        line = next(line for line in lines if name in line)
        return [cell.strip() for cell in line.replace("┃", "│").split("│")[1:-1]]

    assert cells(" images ")[1:] == ["2,448", "50,000"]
    assert cells("against 2,448 images")[1:] == ["1.00", "1.50"]
    assert cells("processor seconds")[1:] == ["4.0", "120.0"]
    assert cells("tables, MiB")[1:] == ["70", "70"]


def test_no_results_are_no_error(tmp_path: Path) -> None:
    assert read_records(tmp_path / "none.jsonl") == []


def test_sweeps_are_compared_with_one_process() -> None:
    console = Console(file=io.StringIO(), width=120)
    ways = {"sweep-1-process": 6.0, "sweep-2-processes": 4.0}
    show(
        [Record(name, *[seconds] * 3, 3, "", "", processor_s=6.5) for name, seconds in ways.items()], console
    )
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    assert "1.50" in text
    assert "COLMAP" not in text


def test_the_whole_command_is_shown_by_stage() -> None:
    console = Console(file=io.StringIO(), width=120)
    warm = Record(
        "command-18-warm",
        3.5,
        3.4,
        3.6,
        3,
        "",
        "",
        processor_s=3.25,
        phases_s={"bundle_adjustment": 1.5},
        phases_processor_s={"bundle_adjustment": 1.25},
    )
    show([warm], console)
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    assert "1.50 / 1.25" in text
    assert "3.50 / 3.25" in text
