"""The tables of the page of a sweep."""

from __future__ import annotations

import pandas as pd

from tasks.sweep.result_tables import SweepResults, failure_table, variant_table


def test_variants_that_fail_for_one_reason_share_a_row() -> None:
    rows = [
        ("low", "none", "plain", "No datum."),
        ("low", "none", "bluh", "No datum."),
        ("low", "5", "plain", None),
        ("low", "5", "bluh", "Too few."),
        ("high", "none", "plain", "No datum."),
    ]
    table = pd.DataFrame(rows, columns=["block", "control", "variant", "reason"])
    table["status"] = ["done" if reason is None else "not_computable" for reason in table["reason"]]
    found = failure_table(SweepResults(table, None)).rows
    assert [row.cells for row in found] == [
        ("low", "none", "plain, bluh", "No datum."),
        ("low", "5", "bluh", "Too few."),
        ("high", "none", "plain", "No datum."),
    ]


def test_what_a_variant_changes_is_written_as_in_a_project_file() -> None:
    changes = ["{}", '{"adjustment.free": ["boresight"], "adjustment.residual_grid.cells": 25}']
    table = pd.DataFrame({"variant": ["none", "grid"], "changes": changes})
    assert [row.cells for row in variant_table(SweepResults(table, None)).rows] == [
        ("none", "nothing"),
        ("grid", 'adjustment.free = ["boresight"], adjustment.residual_grid.cells = 25'),
    ]
