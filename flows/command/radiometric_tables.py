"""Radiometric results of the registry on the screen: their list, and how a camera has changed."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from rich.console import Console
from rich.text import Text

from flows.command.registry_words import empty_table
from tasks.document_kit.table import Number, decimals_for
from tasks.files.json_text import json_text
from tasks.registry.radiometric import RadiometricResult, changes


def print_radiometric(results: Sequence[RadiometricResult]) -> None:
    """A line for each result, camera by camera."""
    console = Console()
    for key in dict.fromkeys(one.record.camera_key for one in results):
        own = [one for one in results if one.record.camera_key == key]
        console.print(Text(f"\nRadiometric results of {own[-1].record.label}", "bold"))
        table = empty_table(
            "result", "version", "examined", "verdict", "added by", "on", right=("result", "version")
        )
        for one in own:
            day = one.record.examined.isoformat() if one.record.examined is not None else "–"
            table.add_row(str(one.id), str(one.version), day, one.record.verdict, one.person, one.at[:10])
        console.print(table)


def show_radiometric(results: Sequence[RadiometricResult], *, as_json: bool) -> None:
    """The results of a camera, and the change of every quantity from one to the next."""
    if as_json:
        print(json_text([one.record.model_dump(mode="json") for one in results], indent=2))
        return
    print_radiometric(results)
    console = Console()
    for before, after in pairwise(results):
        console.print(Text(f"\nFrom result {before.id} to result {after.id}", "bold"))
        table = empty_table(
            "quantity",
            "band",
            "then",
            "now",
            "unit",
            "± σ",
            "in σ",
            right=("band", "then", "now", "± σ", "in σ"),
        )
        for one in changes(before.record, after.record):
            decimals = 0 if one.quantity.startswith("defect") else decimals_for(one.sigma)
            numbers = (Number(value, decimals) for value in (one.then, one.now))
            table.add_row(
                one.quantity.replace("_", " "),
                str(one.band),
                *map(str, numbers),
                one.unit,
                str(Number(one.sigma, max(decimals, 1))),
                Text(str(Number(one.t, 1, plus=True)), "bold yellow" if one.drifted else ""),
            )
        console.print(table)
