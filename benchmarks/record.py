"""The results: one line of JSON for each benchmark, and a table of them."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

RESULTS = Path(__file__).with_name("results.jsonl")
# Images of the operational block, whose time per image point larger ones are measured by.
_OPERATIONAL = 2_448
_SWEEP = "sweep-"
#: How the names of imports begin.
IMPORT = "import-"
#: How the names of selections of additional parameters begin.
SELECTION = "selection-"
#: How the names of trust maps begin.
TRUST_MAP = "trust-map-"
#: How the names of rigs begin.
RIG = "rig-"
#: How the names of the whole command begin.
COMMAND = "command-"


@dataclass(frozen=True)
class Record:
    """What one benchmark has shown; None where it does not apply.

    Attributes
    ----------
    name : of the workload.
    ours_s, peer_s : median seconds, with least and largest.
    ratio : peer / ours.
    runs : number of timed runs of each side.
    images, points, image_points : size of the block.
    peak_memory_mib, peer_peak_memory_mib : largest resident memory of each side's own process.
    processor_s : seconds of all processors together; hardly more on a busy machine.
    tables_mib : size of the tables written.
    cost_difference, position_difference_sigma : see :class:`benchmarks.comparison.Agreement`.
    phases_s : seconds of each part of one iteration, of the statistics and of writing the tables; of each
        stage of the whole command.
    phases_processor_s : the same of all processors together.
    included : what was timed.
    peer, report, peer_report, machine : who ran, what they said, and on what.
    """

    name: str
    ours_s: float
    ours_min_s: float
    ours_max_s: float
    runs: int
    included: str
    machine: str
    peer_s: float | None = None
    peer_min_s: float | None = None
    peer_max_s: float | None = None
    ratio: float | None = None
    images: int | None = None
    points: int | None = None
    image_points: int | None = None
    peak_memory_mib: float | None = None
    peer_peak_memory_mib: float | None = None
    processor_s: float | None = None
    tables_mib: float | None = None
    cost_difference: float | None = None
    position_difference_sigma: float | None = None
    phases_s: dict[str, float] | None = None
    phases_processor_s: dict[str, float] | None = None
    peer: str | None = None
    report: str | None = None
    peer_report: str | None = None


def read_records(file: Path = RESULTS) -> list[Record]:
    """All records of a file; none if it is not there."""
    if not file.exists():
        return []
    return [Record(**json.loads(line)) for line in file.read_text(encoding="utf-8").splitlines()]


def keep(records: Iterable[Record], file: Path = RESULTS) -> None:
    """Write records into a file; they replace those of the same name, new ones go to the end."""
    kept = {record.name: record for record in read_records(file)}
    kept.update({record.name: record for record in records})
    lines = (json.dumps(_rounded(asdict(record)), ensure_ascii=False) for record in kept.values())
    file.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def _rounded(content: object) -> object:
    """Numbers to five digits: more would only be noise."""
    if isinstance(content, float):
        return float(f"{content:.5g}")
    if isinstance(content, dict):
        return {key: _rounded(value) for key, value in content.items()}
    return content


def show(records: Iterable[Record], console: Console | None = None) -> None:
    """Print a table of comparisons and start-up times, and of each other kind of benchmark."""
    records = list(records)
    console = console or Console(width=120)
    sweeps = [record for record in records if record.name.startswith(_SWEEP)]
    imports = [record for record in records if record.name.startswith(IMPORT)]
    selections = [record for record in records if record.name.startswith(SELECTION)]
    maps = [record for record in records if record.name.startswith(TRUST_MAP)]
    of_rigs = [record for record in records if record.name.startswith(RIG)]
    others = [*sweeps, *imports, *selections, *maps, *of_rigs]
    plain = [record for record in records if record.phases_s is None and record not in others]
    commands = [record for record in records if record.name.startswith(COMMAND)]
    grown = [record for record in records if record.phases_s is not None and record not in commands]
    if plain:
        console.print(_comparisons(plain))
    if sweeps:
        console.print(_sweeps(sweeps))
    if imports:
        console.print(_imports(imports))
    if selections:
        console.print(_multiples("12 parameters selected, data snooping", "bare adjustment", selections))
    if of_rigs:
        console.print(_multiples("events of five heads", "single cameras", of_rigs))
    if maps:
        console.print(_multiples("trust map of a million cells", "adjustment with statistics", maps))
    if commands:
        console.print(_commands(commands))
    if grown:
        console.print(_growth(grown))


def _comparisons(records: list[Record]) -> Table:
    table = Table(title="seconds: median (least – largest)")
    for heading in ("", "images", "ours", "COLMAP", "ratio", "MiB", "MiB COLMAP"):
        table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    for record in records:
        table.add_row(
            record.name,
            _count(record.images),
            _spread(record.ours_s, record.ours_min_s, record.ours_max_s),
            _spread(record.peer_s, record.peer_min_s, record.peer_max_s),
            "" if record.ratio is None else f"{record.ratio:.1f}",
            _count(record.peak_memory_mib),
            _count(record.peer_peak_memory_mib),
        )
    return table


def _sweeps(records: list[Record]) -> Table:
    """How much faster than the first of them the others are."""
    table = Table(title="seconds of a sweep: median (least – largest)")
    for heading in ("", "seconds", "processor seconds", "speed-up"):
        table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    for record in records:
        table.add_row(
            record.name,
            _spread(record.ours_s, record.ours_min_s, record.ours_max_s),
            _tenths(record.processor_s),
            f"{records[0].ours_s / record.ours_s:.2f}",
        )
    return table


def _multiples(title: str, own: str, records: list[Record]) -> Table:
    """How much longer than an adjustment of our own of the same block they take."""
    table = Table(title=f"{title}: processor seconds")
    for heading in ("", "images", "image points", "seconds", own, "times", "MiB"):
        table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    for record in records:
        table.add_row(
            record.name,
            _count(record.images),
            _count(record.image_points),
            _spread(record.ours_s, record.ours_min_s, record.ours_max_s),
            "" if record.peer_s is None else f"{record.peer_s:.2f}",
            "" if record.ratio is None else f"{record.ratio:.1f}",
            _count(None if record.peak_memory_mib is None else round(record.peak_memory_mib)),
        )
    return table


def _imports(records: list[Record]) -> Table:
    """Image points per second of the processors and of the clock, and the memory of the process."""
    table = Table(title="import of image points into Parquet")
    for heading in ("", "image points", "seconds", "processor seconds", "points / processor second", "MiB"):
        table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
    for record in records:
        points, processor_s = record.image_points or 0, record.processor_s or float("nan")
        table.add_row(
            record.name,
            _count(points),
            _spread(record.ours_s, record.ours_min_s, record.ours_max_s),
            _tenths(processor_s),
            _count(points / processor_s),
            _count(record.peak_memory_mib),
        )
    return table


def _commands(records: list[Record]) -> Table:
    """One column for each way to run it, one row for each stage."""
    table = Table(title="the whole command: seconds of the clock / of the processors")
    table.add_column("")
    for record in records:
        table.add_column(record.name.removeprefix(COMMAND), justify="right", no_wrap=True)
    for phase in dict.fromkeys(phase for record in records for phase in record.phases_s or {}):
        table.add_row(phase, *(_both(item, phase) for item in records))
    table.add_row("whole", *(f"{item.ours_s:.2f} / {item.processor_s:.2f}" for item in records), style="bold")
    return table


def _both(record: Record, phase: str) -> str:
    clock, processor = (record.phases_s or {}).get(phase), (record.phases_processor_s or {}).get(phase)
    return "" if clock is None or processor is None else f"{clock:.2f} / {processor:.2f}"


def _growth(records: list[Record]) -> Table:
    """One column for each size, one row for each phase."""
    records = sorted(records, key=lambda record: record.images or 0)
    table = Table(
        title="µs per image point: each phase once; the whole adjustment with statistics and tables"
    )
    table.add_column("images")
    for record in records:
        table.add_column(_count(record.images), justify="right")
    for phase in dict.fromkeys(phase for record in records for phase in record.phases_s or {}):
        table.add_row(phase, *(_per_image_point((item.phases_s or {}).get(phase), item) for item in records))
    table.add_row("whole", *(_per_image_point(item.ours_s, item) for item in records), style="bold")
    operational = [_seconds_per_image_point(item) for item in records if item.images == _OPERATIONAL]
    if operational:
        ratios = (f"{_seconds_per_image_point(item) / operational[0]:.2f}" for item in records)
        table.add_row(f"against {_count(_OPERATIONAL)} images", *ratios)
    table.add_row("seconds", *(f"{item.ours_s:.2f}" for item in records))
    table.add_row("processor seconds", *(_tenths(item.processor_s) for item in records))
    table.add_row("peak memory, MiB", *(_count(item.peak_memory_mib) for item in records))
    table.add_row("tables, MiB", *(_count(item.tables_mib) for item in records))
    return table


def _seconds_per_image_point(record: Record) -> float:
    """NaN where the image points were not counted."""
    return record.ours_s / record.image_points if record.image_points else float("nan")


def _per_image_point(seconds: float | None, record: Record) -> str:
    return "" if seconds is None or not record.image_points else f"{1e6 * seconds / record.image_points:.3f}"


def _tenths(value: float | None) -> str:
    return "" if value is None else f"{value:,.1f}"


def _count(value: float | None) -> str:
    return "" if value is None else f"{value:,.0f}"


def _spread(middle: float | None, least: float | None, largest: float | None) -> str:
    return "" if middle is None else f"{middle:.2f} ({least:.2f} – {largest:.2f})"
