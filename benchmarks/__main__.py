"""The command ``python -m benchmarks``: see README.md next to this file."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

from benchmarks.record import RESULTS, Record, keep, read_records, show
from benchmarks.workload import COMMANDS, GROWTH, RIGS, SELECTIONS, TRUST_MAPS, WORKLOADS, Workload
from flows.runs.freed_memory import keep_freed_memory


def main() -> None:
    """Run what was requested, write the results and show them."""
    options = _options()
    file: Path = options.results
    for record in _records(options):
        keep([record], file)
    show(read_records(file))


def _records(options: argparse.Namespace) -> Iterable[Record]:
    """The records of a command, as they come."""
    if options.command == "compare":
        from benchmarks.comparison import compare

        for workload in _chosen(WORKLOADS, options.workload, large=True):
            yield from compare(workload, options.runs)
    elif options.command == "growth":
        from benchmarks.growth import grow

        yield from map(grow, _chosen(GROWTH, options.workload, options.large))
    elif options.command == "start-up":
        from benchmarks.start_up import start_up

        yield from start_up(options.runs)
    elif options.command == "command":
        from benchmarks.command import command

        for workload in _chosen(COMMANDS, options.workload, large=True):
            yield from command(workload, options.runs)
    elif options.command == "import":
        from benchmarks.importing import importing

        yield importing(options.runs)
    elif options.command == "selection":
        from benchmarks.selection import selection

        for workload in _chosen(SELECTIONS, options.workload, large=True):
            yield selection(workload, options.runs)
    elif options.command == "trust-map":
        from benchmarks.trust_map import trust_map

        yield from map(trust_map, _chosen(TRUST_MAPS, options.workload, options.large))
    elif options.command == "rigs":
        from benchmarks.rigs import rigs

        yield from map(rigs, _chosen(RIGS, options.workload, options.large))
    elif options.command == "sweep":
        from benchmarks.sweep import sweep

        yield from sweep(options.runs)


def _chosen(workloads: Iterable[Workload], names: list[str], large: bool) -> list[Workload]:
    """Those of the given names; without names all, the large ones only where wanted."""
    return [item for item in workloads if item.name in names or (not names and (large or not item.large))]


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    commands = [
        "compare",
        "growth",
        "start-up",
        "command",
        "import",
        "selection",
        "trust-map",
        "rigs",
        "sweep",
        "show",
    ]
    parser.add_argument("command", choices=commands)
    parser.add_argument("--workload", action="append", default=[], metavar="NAME", help="only this one")
    parser.add_argument("--runs", type=int, default=5, help="timed runs of each side")
    parser.add_argument("--large", action="store_true", help="growth, trust-map, rigs: the largest, too")
    parser.add_argument("--results", type=Path, default=RESULTS, help="file of the results")
    return parser.parse_args()


if __name__ == "__main__":
    keep_freed_memory()  # as every process of aerocal; selections are measured in this one
    main()
