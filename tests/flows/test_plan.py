"""``aerocal plan``: the nine flight patterns with their published figures, verdicts, proposals, projects."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from flows.command.plan_execution import PlanOptions, execute_plan
from flows.runs.project_run import RunRequest, carry_out
from flows.stories.project_plan import plan_of_project, plan_of_specification
from tasks.errors import InputError, NotComputableError
from tasks.planning.plan import CalibrationPlan
from tasks.planning.request import free_from_text, selection_from_text
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.flows.adjustment_alone import adjustment_alone

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "flight_patterns"
NAMES = (
    "focal_length",
    "principal_point_x",
    "principal_point_y",
    "gnss_shift_x",
    "gnss_shift_y",
    "gnss_shift_z",
    "boresight_roll",
    "boresight_pitch",
    "boresight_yaw",
)
# σ with independent errors: c, x0, y0 in µm, shift in cm, boresight in millidegrees; independent computation.
PUBLISHED = {
    1: (9.72, 4.85, 4.82, 4.76, 4.73, 9.48, 0.41, 0.41, 0.88),
    2: (9.85, 0.57, 0.58, 0.65, 0.66, 9.61, 0.37, 0.36, 0.88),
    3: (6.68, 0.39, 0.38, 0.49, 0.49, 6.52, 0.24, 0.25, 0.63),
    4: (6.63, 0.39, 0.38, 0.48, 0.49, 6.48, 0.25, 0.26, 0.61),
    5: (0.82, 0.94, 0.95, 1.23, 1.21, 1.13, 0.39, 0.37, 0.82),
    6: (0.82, 0.41, 0.40, 0.63, 0.64, 1.13, 0.34, 0.34, 0.82),
    7: (0.59, 0.28, 0.27, 0.47, 0.48, 0.82, 0.23, 0.23, 0.59),
    8: (0.61, 0.29, 0.28, 0.46, 0.48, 0.82, 0.23, 0.24, 0.58),
    9: (0.44, 0.20, 0.19, 0.37, 0.38, 0.60, 0.16, 0.17, 0.41),
}
# ρ of x0 with the shift in x, y0 with y, c with z.
CORRELATIONS = {
    1: (-0.99, -0.99, -1.00),
    2: (0.00, 0.00, -1.00),
    3: (0.00, 0.00, -1.00),
    4: (0.00, -0.01, -1.00),
    5: (-0.85, -0.83, -0.85),
    6: (0.00, 0.00, -0.84),
    7: (0.00, 0.00, -0.82),
    8: (-0.01, -0.01, -0.83),
    9: (0.00, 0.00, -0.79),
}
# With a lever arm in place of the shift: the three ρ, then σ of x0 in µm and of the lever arm in x in cm.
WITH_LEVER_ARM = {
    1: (-0.99, 0.99, 1.00, 5.1, 5.0),
    2: (-0.91, 0.93, 1.00, 1.4, 1.5),
    3: (-0.89, 0.90, 1.00, 0.86, 0.91),
    4: (-0.89, 0.92, 1.00, 0.86, 0.91),
    5: (-0.85, 0.83, 0.85, 0.95, 1.2),
    6: (-0.84, 0.85, 0.85, 0.75, 1.0),
    7: (-0.83, 0.84, 0.82, 0.51, 0.70),
    8: (-0.83, 0.84, 0.83, 0.52, 0.70),
    9: (-0.83, 0.84, 0.79, 0.36, 0.49),
}
FACTOR = {"mm": 1e3, "deg": 1e3, "m": 100.0}
LEVER = ("focal_length", "principal_point", "boresight", "lever_arm")


def pattern(number: int) -> str:
    return str(EXAMPLES / f"pattern-{number}.toml")


@cache
def planned(number: int, **settings: Any) -> CalibrationPlan:
    """The plan of a pattern, which several tests read."""
    return plan_of_specification(pattern(number), propose=settings.pop("propose", False), **settings)


def sigmas(plan: CalibrationPlan) -> dict[str, float]:
    table = plan.expectation.parameters
    return {
        str(row["parameter"]): float(row["sigma"]) * FACTOR[str(row["unit"])]
        for row in table.to_dict("records")
    }


def correlation(plan: CalibrationPlan, one: str, other: str) -> float:
    table = plan.expectation.correlations
    rows = table[table["parameter_a"].isin([one, other]) & table["parameter_b"].isin([one, other])]
    return float(rows["correlation"].iloc[0])


@pytest.mark.parametrize("number", range(1, 10))
def test_standard_deviations_and_correlations_of_the_nine_patterns(number: int) -> None:
    plan = planned(number, strip_bias_m=0.0)
    found = sigmas(plan)
    tolerance = 0.30 if number == 1 else 0.15
    np.testing.assert_allclose([found[name] for name in NAMES], PUBLISHED[number], rtol=tolerance)
    pairs = zip(NAMES[1:3] + NAMES[:1], NAMES[3:6], CORRELATIONS[number], strict=True)
    for one, other, published in pairs:
        assert correlation(plan, one, other) == pytest.approx(published, abs=0.03)


# Pattern 9 has the crossing lines and the lines flown twice of the others as well.
@pytest.mark.parametrize(
    "number", [pytest.param(k, marks=pytest.mark.slow if k in (3, 4, 7, 8) else ()) for k in range(1, 10)]
)
def test_the_nine_patterns_with_a_lever_arm_in_place_of_the_shift(number: int) -> None:
    plan = planned(number, strip_bias_m=0.0, free=LEVER)
    *rho, x0, arm = WITH_LEVER_ARM[number]
    for one, other, published in zip(
        NAMES[1:3] + NAMES[:1], ("lever_arm_x", "lever_arm_y", "lever_arm_z"), rho, strict=True
    ):
        assert correlation(plan, one, other) == pytest.approx(published, abs=0.03)
    found = sigmas(plan)
    assert found["principal_point_x"] == pytest.approx(x0, rel=0.15)
    assert found["lever_arm_x"] == pytest.approx(arm, rel=0.15)


@pytest.mark.parametrize(
    ("number", "reasons"),
    [
        (1, ("one direction only", "one height", "focal_length", "principal_point_x", "gnss_shift_z")),
        (2, ("one height", "focal_length", "gnss_shift_z")),
        (3, ("one height", "focal_length", "gnss_shift_z")),
        (4, ("one height", "focal_length", "gnss_shift_z")),
        (5, ("one direction only", "principal_point_x", "principal_point_y")),
        (7, ()),
        (8, ()),
        (9, ()),
    ],
)
def test_verdicts_with_a_strip_bias_of_3_cm(number: int, reasons: tuple[str, ...]) -> None:
    flight = planned(number, propose=number < 6).expectation.flight
    assert flight.verdict == ("refused" if reasons else "accepted")
    for reason in reasons:
        assert any(reason in sentence for sentence in flight.reasons), reason
    if not reasons:
        assert flight.reasons == ()
    if number in (2, 3, 4):
        assert not any("direction only" in sentence for sentence in flight.reasons)
    if number == 5:
        assert not any("one height" in sentence for sentence in flight.reasons)


@pytest.mark.parametrize(
    ("number", "bias", "published"),
    # σ of c and x0 in µm; of the mean of the shifts that really were there, not of the shift itself, in cm.
    [(1, 0.03, (9.8, 5.0)), (3, 0.03, (6.8, 0.65)), (7, 0.03, (1.05, 0.45)), (7, 0.05, (1.54, 0.57)),
     (9, 0.03, (0.74, 0.32)), (9, 0.05, (1.07, 0.39))],
)  # fmt: skip
def test_what_a_bias_common_to_a_strip_costs(
    number: int, bias: float, published: tuple[float, float]
) -> None:
    found = sigmas(planned(number, strip_bias_m=bias))
    np.testing.assert_allclose([found[name] for name in NAMES[:2]], published, rtol=0.15)
    if number == 7 and bias == 0.03:
        np.testing.assert_allclose([found[name] for name in NAMES[3:6]], (0.91, 0.92, 1.69), rtol=0.05)


def test_the_pattern_near_the_limit_fails_with_5_cm_by_focal_length_and_height() -> None:
    assert planned(6).expectation.accepted
    worse = planned(6, strip_bias_m=0.05)
    weak = {item.parameter: item for item in worse.expectation.quantities if item.verdict == "weak"}
    assert set(weak) == {"focal_length", "gnss_shift_z"}
    assert weak["focal_length"].sigma == pytest.approx(2.15e-3, rel=0.05)
    for number in (7, 8, 9):
        assert planned(number, strip_bias_m=0.05).expectation.accepted


def test_free_shifts_of_the_strips_destroy_the_calibration_and_are_refused_with_the_number() -> None:
    plan = planned(7, strip_bias_m=10.0)
    assert plan.expectation.flight.verdict == "refused"
    found = sigmas(plan)
    assert found["focal_length"] == pytest.approx(5.5, rel=0.15)
    (sentence,) = (item for item in plan.expectation.flight.reasons if "strips are free" in item)
    number = re.search(r"focal_length ([0-9.]+) µm", sentence)
    assert number is not None
    assert float(number.group(1)) == pytest.approx(found["focal_length"], abs=0.01)


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5])
def test_the_cheapest_addition_is_computed_and_suffices(number: int) -> None:
    plan = planned(number, propose=True)
    cheapest = plan.cheapest
    assert cheapest is not None
    assert cheapest.expectation.accepted
    assert all(not item.expectation.accepted for item in plan.proposals[:-1])
    costs = [item.addition.cost for item in plan.proposals]
    assert costs == sorted(costs)
    assert 0 < cheapest.addition.exposures < plan.expectation.images
    kinds = {group.what for group in cheapest.addition.groups}
    assert ("height" in kinds) == (number < 5)


def test_a_proposal_written_into_the_flight_plan_gives_what_it_promised(tmp_path: Path) -> None:
    """The cheapest addition to pattern 1 as lines of a specification, with deviations of its own."""
    cheapest = planned(1, propose=True).cheapest
    assert cheapest is not None
    (group,) = cheapest.addition.groups
    text = Path(pattern(1)).read_text(encoding="utf-8")
    lines = f"""
[[flight]]
name = "H"
height_m = {group.height:.0f}.0
heading_deg = {np.rad2deg(group.heading):.3f}
lines = {group.lines}
exposures = {len(group.strips[0].plan)}
end_lap = 0.6
directions = "both"

[trajectory]"""
    flown = tmp_path / "flown.toml"
    flown.write_text(text.replace("\n[trajectory]", lines), encoding="utf-8")
    plan = plan_of_specification(str(flown), propose=False)
    assert plan.expectation.accepted
    assert plan.expectation.images == cheapest.expectation.images
    promised = {item.parameter: item.sigma for item in cheapest.expectation.quantities}
    for item in plan.expectation.quantities:
        assert item.sigma == pytest.approx(promised[item.parameter], rel=0.1)


def test_a_project_is_planned_like_the_specification_it_was_simulated_from(tmp_path: Path) -> None:
    """The same geometry by way of files, import and intersection; nothing is left behind."""
    overrides = ("noise.level=0",)
    project = simulate_project(load_simulation(pattern(6), overrides), tmp_path / "block").project_file
    before = sorted(project.parent.rglob("*"))
    of_files = sigmas(plan_of_project(str(project), propose=False))
    of_plan = sigmas(plan_of_specification(pattern(6), overrides, propose=False))
    for name in NAMES:
        assert of_files[name] == pytest.approx(of_plan[name], rel=5e-3)
    assert sorted(project.parent.rglob("*")) == before


def test_a_project_without_strips_cannot_have_an_error_common_to_a_strip(tmp_path: Path) -> None:
    project = simulate_project(load_simulation(pattern(2)), tmp_path / "block").project_file
    exposures = project.parent / "exposures.csv"
    head, *rows = exposures.read_text(encoding="utf-8").splitlines()
    column = head.split(",").index("strip")
    cells = [row.split(",") for row in rows]
    blank = [",".join("" if k == column else cell for k, cell in enumerate(row)) for row in cells]
    exposures.write_text("\n".join([head, *blank]) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match="no strips"):
        plan_of_project(str(project), propose=False)
    expectation = plan_of_project(str(project), strip_bias_m=0.0, propose=False).expectation
    assert len(expectation.pattern.directions) == 2


def options(source: str, **changes: Any) -> PlanOptions:
    defaults: dict[str, Any] = {
        "free": None, "additional": None, "strip_bias": None, "overrides": (), "data": None,
        "proposals": True,
    }  # fmt: skip
    return PlanOptions(source, **{**defaults, **changes})


def test_the_exit_code_is_the_verdict_and_json_says_everything(capsys: pytest.CaptureFixture[str]) -> None:
    assert execute_plan(options(pattern(2)), as_json=True) == 4
    refused = json.loads(capsys.readouterr().out)
    assert refused["verdict"] == "refused"
    assert refused["pattern"]["opposite"]
    assert refused["cheapest"]["verdict"] == "accepted"
    strips = refused["cheapest"]["addition"]["strips"]
    assert sum(strip["exposures"] for strip in strips) == refused["cheapest"]["addition"]["images"]
    assert {item["verdict"] for item in refused["parameters"]} >= {"determined", "not_determinable"}
    assert len(refused["correlations"]) == 36
    assert execute_plan(options(pattern(7)), as_json=True) == 0
    assert json.loads(capsys.readouterr().out)["proposals"] == []


def test_the_screen_shows_verdict_reasons_and_proposal(capsys: pytest.CaptureFixture[str]) -> None:
    execute_plan(options(pattern(1)), as_json=False)
    output = capsys.readouterr().out
    shown = " ".join(output.split())
    for words in (
        "pattern-1: refused",
        "not determinable",
        "Flown in one direction only",
        "Cheapest addition that meets the limits",
    ):
        assert words in shown
    assert max(map(len, output.splitlines())) <= 80


def test_additional_parameters_take_their_part_of_the_interior_orientation() -> None:
    """P1 and P2 go with principal point and boresight."""
    without, given = sigmas(planned(2)), planned(2, additional="brown:K1,K2,P1,P2")
    table = given.expectation.parameters.set_index("parameter")["sigma"]
    assert {"brown:K1", "brown:K2", "brown:P1", "brown:P2"} <= set(table.index)
    assert table["principal_point_x"] * 1e3 > 1.1 * without["principal_point_x"]
    assert table["boresight_roll"] * 1e3 > 1.4 * without["boresight_roll"]
    verdicts = {item.parameter: item.verdict for item in given.expectation.quantities}
    assert verdicts["boresight_roll"] == "weak"


def test_proposals_hold_with_additional_parameters() -> None:
    cheapest = planned(5, additional="brown:K1,K2,P1,P2", propose=True).cheapest
    assert cheapest is not None
    assert cheapest.expectation.accepted


def test_one_distortion_in_two_units_is_not_determinable() -> None:
    flight = planned(7, additional="brown:K1+brown_mm:K1").expectation.flight
    assert flight.verdict == "refused"
    assert any("brown:K1" in reason and "not determinable" in reason for reason in flight.reasons)
    with pytest.raises(InputError, match="bluh:99"):
        selection_from_text("bluh:99")


def test_limits_come_from_the_file() -> None:
    plan = planned(7, overrides=("calibration.limits.focal_length_um=0.5",))
    weak = [item.parameter for item in plan.expectation.quantities if item.verdict == "weak"]
    assert weak == ["focal_length"]


def test_names_of_parameters_are_checked() -> None:
    assert free_from_text("boresight, lever_arm") == ("boresight", "lever_arm")
    with pytest.raises(InputError, match="lever_arm"):
        free_from_text("boresight,leverarm")
    with pytest.raises(InputError, match="names no parameter"):
        free_from_text(" , ")


def test_a_flight_without_overlap_is_not_computable_or_wrong_input() -> None:
    with pytest.raises((InputError, NotComputableError)):
        planned(1, overrides=("flight.0.base_m=5000", "flight.0.spacing_m=9000"))


def of_heads(table: pd.DataFrame) -> pd.Series:
    """σ by parameter and entity, of what is estimated."""
    return table.set_index(["parameter", "entity"])["sigma"].dropna()


@pytest.mark.parametrize(
    ("preset", "parameters"),
    [("penta", 5 * 3 + 3 + 3 + 4 * 3 + 4), ("dmc-heads", 4 * 3)],
)
def test_a_rig_is_planned_as_its_adjustment_determines_it(
    tmp_path: Path, preset: str, parameters: int
) -> None:
    """The specification, the project simulated from it, and an adjustment of this project."""
    flown = ("flight.lines=3", "flight.exposures=6", "points.count=200")
    simulation = load_simulation(preset, flown, 3)
    project = simulate_project(simulation, tmp_path / "flight").project_file
    before = sorted(project.parent.rglob("*"))
    of_plan = plan_of_specification(preset, (*flown, "seed=3"), propose=False)
    of_files = plan_of_project(str(project), propose=False)
    assert sorted(project.parent.rglob("*")) == before
    free = ",".join(f'"{name}"' for name in of_plan.request.free)
    overrides = (f"adjustment.free=[{free}]", 'adjustment.sigma0="a_priori"')
    found = carry_out(adjustment_alone, RunRequest(project, tmp_path / "out", overrides))
    assert found.error is None, found.error
    adjusted = of_heads(pd.read_parquet(found.directory / "parameters.parquet"))
    assert len(adjusted) == parameters
    for plan in (of_plan, of_files):
        sigma = of_heads(plan.expectation.parameters)
        assert set(sigma.index) == set(adjusted.index)
        np.testing.assert_allclose(sigma[adjusted.index], adjusted, rtol=0.02)
    heads = 5 if preset == "penta" else 4
    for expectation in (of_plan.expectation, of_files.expectation):
        assert expectation.images == heads * expectation.exposures
        assert len(expectation.pattern.directions) == 2


def test_focal_lengths_of_converging_heads_need_no_second_height(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert execute_plan(options("penta"), as_json=False) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "penta: accepted" in shown
    assert "exposures of the rig 60" in shown
    assert "from heads that look in different directions" in shown


def test_additional_exposures_of_a_rig_are_proposed_with_all_heads(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The boresight in yaw is 7 % worse than its limit: σ falls with the number of exposures."""
    overrides = ("points.count=200", "noise.ins_deg=[0.003,0.003,0.0083]")
    assert execute_plan(options("penta", overrides=overrides), as_json=True) == 4
    found = json.loads(capsys.readouterr().out)
    cheapest = found["cheapest"]
    assert found["network"]["images"] == 5 * found["network"]["exposures"] == 300
    assert cheapest["verdict"] == "accepted"
    assert cheapest["addition"]["images"] == 5 * cheapest["addition"]["exposures"] > 0
    # The heads converge: whether there is a second height, σ alone decides.
    assert found["proposals"][0]["addition"]["exposures"] == 0


def test_mountings_of_heads_without_a_rig_are_refused() -> None:
    with pytest.raises(InputError, match="no camera is a head"):
        planned(7, free=("boresight", "relative_rotation"))
