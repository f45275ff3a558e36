"""summary.json: what the stages report, put together; null for what does not exist."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tasks.files.json_text import JSON
from tasks.results import quality_gates
from tasks.results.quality_gates import GateResult
from tasks.results.summary import failed_summary, read_summary, summary_of, write_summary
from tasks.settings.quality import AxisGate, Gate, Gates
from tasks.store.notes import Notes

#: The fields of the contract, version 1.
FIELDS = {
    "contract_version",
    "status",
    "sigma0",
    "sigma0_um",
    "sigma0_px",
    "redundancy",
    "iterations",
    "counts",
    "rmse_control_m",
    "max_control_m",
    "rmse_check_m",
    "max_check_m",
    "check_point_test",
    "distances",
    "parameters",
    "direct_georeferencing",
    "deliveries",
    "gates",
    "timings_s",
    "problems",
}

INGEST = Notes(("two points were dropped",), {"counts": {"images": 20}})
ADJUSTMENT = Notes(
    ("the block is weak", "two points were dropped"),
    {
        "sigma0": 1.065,
        "sigma0_um": float("nan"),
        "redundancy": 16888,
        "counts": {"object_points": 3000, "rejected": 0},
        "rmse_control_m": [0.01, 0.02, float("nan")],
        "max_control_m": [0.03, 0.05, 0.21],
        "parameters": [{"parameter": "boresight_roll", "entity": "UCE", "value": 0.1, "sigma": None}],
        "datum": "GNSS positions",
    },
)


def written(tmp_path: Path, gates: Gates) -> dict[str, object]:
    summary = summary_of([INGEST, ADJUSTMENT], gates, {"bundle_adjustment": 1.5, "total": 1.5})
    write_summary(tmp_path, summary)
    assert read_summary(tmp_path).status == summary.status
    content = json.loads((tmp_path / "summary.json").read_text())
    assert isinstance(content, dict)
    return content


def test_figures_of_all_stages_are_put_together(tmp_path: Path) -> None:
    content = written(tmp_path, Gates())
    assert set(content) >= FIELDS
    assert content["sigma0"] == 1.065
    assert content["counts"] == {
        "images": 20,
        "object_points": 3000,
        "image_points": None,
        "rejected": 0,
        "control": None,
        "check": None,
    }
    assert content["datum"] == "GNSS positions"
    assert content["problems"] == ["two points were dropped", "the block is weak"]
    assert content["status"] == "done"
    assert content["contract_version"] == 1


def test_why_the_result_as_a_whole_is_refused_comes_first() -> None:
    verdict = Notes(("refused: one height", "a remark"), reasons=("refused: one height",))
    summary = summary_of([INGEST, ADJUSTMENT, verdict], Gates(), {})
    assert summary.problems == (
        "refused: one height",
        "two points were dropped",
        "the block is weak",
        "a remark",
    )


def test_what_does_not_exist_is_null_and_never_nan(tmp_path: Path) -> None:
    content = written(tmp_path, Gates())
    assert content["sigma0_um"] is None
    assert content["rmse_control_m"] == [0.01, 0.02, None]
    assert content["rmse_check_m"] is None
    assert content["direct_georeferencing"] is None
    assert "NaN" not in (tmp_path / "summary.json").read_text()


@pytest.mark.parametrize(
    ("gate", "status", "passed"),
    [
        (Gate(max=1.2), "done", [True]),
        (Gate(max=1.0), "gate_failed", [False]),
        (Gate(min=0.8, max=1.065), "done", [True, True]),
        (Gate(min=1.1), "gate_failed", [False]),
    ],
)
def test_a_gate_decides_the_status(tmp_path: Path, gate: Gate, status: str, passed: list[bool]) -> None:
    content = written(tmp_path, Gates(sigma0=gate))
    assert content["status"] == status
    gates = content["gates"]
    assert isinstance(gates, list)
    assert [entry["passed"] for entry in gates] == passed
    assert all(entry["name"] == "sigma0" and entry["value"] == 1.065 for entry in gates)


def test_a_gate_with_three_components_tests_each_axis(tmp_path: Path) -> None:
    gates = written(tmp_path, Gates(rmse_control_m=AxisGate(max=(0.02, 0.01, 0.05))))["gates"]
    assert isinstance(gates, list)
    assert [(entry["name"], entry["passed"], entry["unit"]) for entry in gates] == [
        ("rmse_control_m_x", True, "m"),
        ("rmse_control_m_y", False, "m"),
        ("rmse_control_m_z", False, "m"),
    ]


def test_the_largest_control_residual_has_a_gate_of_its_own(tmp_path: Path) -> None:
    content = written(tmp_path, Gates(max_control_m=AxisGate(max=(0.2, 0.2, 0.2))))
    gates = content["gates"]
    assert isinstance(gates, list)
    assert [(entry["name"], entry["value"], entry["passed"]) for entry in gates] == [
        ("max_control_m_x", 0.03, True),
        ("max_control_m_y", 0.05, True),
        ("max_control_m_z", 0.21, False),
    ]
    assert content["status"] == "gate_failed"


def test_a_gate_whose_figure_does_not_exist_has_not_been_passed(tmp_path: Path) -> None:
    content = written(tmp_path, Gates(rmse_check_m=AxisGate(max=(0.1, 0.1, 0.1))))
    assert content["status"] == "gate_failed"
    problems = content["problems"]
    assert isinstance(problems, list)
    assert problems[0].startswith("The gate rmse_check_m counts as failed")


def test_a_gate_of_a_trust_map_that_nothing_limits_says_where() -> None:
    gates = Gates(trust_map_height_m=Gate(max=0.1), trust_map_external_m=Gate(max=0.5))
    of_map: JSON = {"share": 0.95, "unmapped": 0.02, "uncontrolled": 0.6}
    figures: dict[str, JSON] = {"sigma0": 1.0, "trust_map": of_map, "trust_map_height_m": 0.05}
    results, (sentence,) = quality_gates.tested_gates(gates, {**figures, "trust_map_external_m": None})
    assert [result.passed for result in results] == [True, False]
    assert sentence == (
        "The gate trust_map_external_m counts as failed: its value is unlimited on more than 5.0 % of the "
        "area (2.0 % of the area is not mapped; 60.0 % of the mapped cells have new image coordinates "
        "without control, as two rays always do)."
    )
    (sentence,) = quality_gates.tested_gates(Gates(trust_map_height_m=Gate(max=0.1)), {"sigma0": 1.0})[1]
    assert sentence.endswith("this run has no such figure to test.")


def test_a_run_without_a_result_has_the_same_fields(tmp_path: Path) -> None:
    write_summary(tmp_path, failed_summary("input_error", ("The file is empty.",), {}))
    content = json.loads((tmp_path / "summary.json").read_text())
    assert set(content) == FIELDS
    assert content["status"] == "input_error"
    assert content["problems"] == ["The file is empty."]
    assert content["sigma0"] is None


@pytest.mark.parametrize(
    ("value", "limit", "bound", "expected"),
    [
        (1.5, 1.2, "max", ("1.5", "1.2")),
        (1.20004, 1.2, "max", ("1.20004", "1.2")),
        (1.2000000004, 1.20000000035, "max", ("1.2000000004", "1.20000000035")),
        (0.0499996, 0.05, "min", ("0.0499996", "0.05")),
        (1.19997, 1.19998, "max", ("1.19997", "1.19998")),
        (123456.0, 120000.0, "max", ("1.235e+05", "120000")),
        (None, 0.05, "max", ("none", "0.05")),
    ],
)
def test_a_figure_beyond_its_limit_does_not_look_like_one_that_meets_it(
    value: float | None, limit: float, bound: Any, expected: tuple[str, str]
) -> None:
    passed = value is not None and (value <= limit if bound == "max" else value >= limit)
    gate = GateResult(name="sigma0", value=value, limit=limit, unit="1", bound=bound, passed=passed)
    assert gate.words == expected


def test_what_refuses_a_result_is_not_said_again_as_a_remark() -> None:
    doubt = Notes(("the heights look wrong", "the block is weak"), {})
    judged = Notes(("Refused: the heights look wrong",), {}, reasons=("Refused: the heights look wrong",))
    assert summary_of([doubt, judged], Gates(), {}).problems == (
        "Refused: the heights look wrong",
        "the block is weak",
    )
