"""What can speak against a calibration besides its σ: each way by itself, and nothing without one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from tasks.calibration.evidence import Evidence
from tasks.calibration.two_step_comparison import comparison
from tasks.calibration.verdicts import FlightVerdict
from tasks.results.calibration_figures import ComparedStepFigure, StepComparisonFigure
from tasks.results.figures import figures_of
from tasks.results.quality_gates import GateResult
from tasks.settings.calibration import AcceptanceLimits

LIMITS = AcceptanceLimits()
STRIPS, IN_STRIP = 10, 10
IMAGES = [f"{strip:02d}_{k}" for strip in range(STRIPS) for k in range(IN_STRIP)]
GROUPS = ("image_points", "control_points", "gnss_positions", "ins_attitudes")
ADJUSTED: dict[str, Any] = {
    "model_findings": [],
    "moved_by_findings": 0.0,
    "strip_scatter": [],
    "restored_groups": [],
    "variance_components": None,
    "groups": [{"group": name, "observations": 400, "sigma0": 1.0, "redundancy": 300.0} for name in GROUPS],
}
FINDING = {
    "rank": 1,
    "quantity": "lever_arm",
    "entity": "UCE",
    "scope": "all",
    "part": "",
    "t": 9.0,
    "moves": "GNSS shift x of 1",
    "moved_by": 5.0,
    "sentence": "The lever arm looks wrong.",
}
SCATTER = {
    "quantity": "boresight_pitch",
    "entity": "UCE",
    "unit": "deg",
    "strips": STRIPS,
    "probability": 1e-6,
    "scatter": 0.003,
    "statistic": 90.0,
    "freedom": 9,
    "moved_by": 2.0,
}
DIRECT: dict[str, Any] = {
    "rmse_m": [0.03, 0.03, 0.06],
    "predicted_rmse_m": [0.03, 0.03, 0.06],
    "degrees_of_freedom": [35.0, 35.0, 35.0],
    "mean_m": [0.0, 0.0, 0.0],
    "predicted_mean_sigma_m": [0.008, 0.008, 0.015],
}


def residuals() -> pd.DataFrame:
    """Positions, attitudes, control and the biases of the strips, all used."""
    rows = [(group, image, None, "used") for group in ("gnss_positions", "ins_attitudes") for image in IMAGES]
    rows += [("control_points", None, f"C{k}", "used") for k in range(50)]
    rows += [("prior:gnss_strip_bias", None, None, "used")] * STRIPS
    rows += [("prior:boresight", None, None, "used")]
    table = pd.DataFrame(rows, columns=["group", "image", "point", "status"])
    components = {"prior:boresight": "boresight_roll", "prior:gnss_strip_bias": "gnss_strip_bias_x"}
    table["component"] = table["group"].map(components).fillna("x")
    return table.assign(residual=0.01, sigma=0.03, unit="m", standardized=0.5)


def rejected(group: str, count: int, start: int = 0) -> pd.DataFrame:
    table = residuals()
    rows = table.index[table["group"] == group][start : start + count]
    table.loc[rows, "status"] = "rejected"
    return table


def most_of_a_strip() -> pd.DataFrame:
    """Five of the seven positions of a strip, which are five hundredths of all."""
    table = rejected("gnss_positions", 5)
    return table[~((table["group"] == "gnss_positions") & table["image"].isin(IMAGES[7:10]))]


def contradicting(group: str) -> pd.DataFrame:
    table = residuals()
    table.loc[table.index[table["group"] == group][0], "standardized"] = 9.0
    return table


GOOD = Evidence(
    suspicions=(),
    adjusted=figures_of(ADJUSTED),
    residuals=residuals(),
    images=pd.DataFrame(
        {"image": IMAGES, "flight": ["1"] * 50 + ["2"] * 50, "strip": [name[:2] for name in IMAGES]}
    ),
    direct=DIRECT,
    gates=(GateResult(name="sigma0", value=1.0, limit=1.2, unit="1", passed=True),),
    steps=None,
    mountings=(),
)


def adjusted(**changes: Any) -> Evidence:
    return replace(GOOD, adjusted=figures_of({**ADJUSTED, **changes}))


def sigma0(group: str, value: float, redundancy: float = 300.0) -> Evidence:
    others = [item for item in ADJUSTED["groups"] if item["group"] != group]
    return adjusted(
        groups=[*others, {**ADJUSTED["groups"][0], "group": group, "sigma0": value, "redundancy": redundancy}]
    )


def component(part: str, lower: float, upper: float) -> Evidence:
    """A part whose σ were estimated."""
    factor = {"factor": (lower * upper) ** 0.5, "factor_lower": lower, "factor_upper": upper}
    rest = {"sigma": 0.03, "unit": "m", "redundancy": 90.0, "degrees_of_freedom": 90.0}
    item = {"part": part, "estimated": True, **factor, **rest}
    limits = dict.fromkeys(("factor_lower", "factor_upper"))
    kept = {"part": "control_points plan", "estimated": False, "factor": 1.0, **limits, **rest}
    return adjusted(variance_components={"rounds": 2, "confidence": 0.95, "components": [kept, item]})


def checked(**changes: list[float]) -> Evidence:
    return replace(GOOD, direct={**DIRECT, **changes})


def compared(probability: float) -> StepComparisonFigure:
    item = ComparedStepFigure(
        parameter="boresight_roll",
        entity="UCE",
        unit="deg",
        one_step=0.01,
        one_step_sigma=0.001,
        two_step=0.02,
        two_step_sigma=0.001,
        difference=-0.01,
        t=-7.07,
    )
    return comparison((item,), float(stats.chi2.isf(probability, 1)))


def test_without_anything_against_it_a_flight_is_accepted() -> None:
    assert GOOD.objections(LIMITS) == ((), ())
    assert replace(GOOD, direct={}).objections(LIMITS) == ((), ())
    assert replace(GOOD, steps=compared(0.05)).objections(LIMITS) == ((), ())


@pytest.mark.parametrize(
    ("evidence", "words"),
    [
        (replace(GOOD, suspicions=("The heights look orthometric.",)), "orthometric"),
        (adjusted(model_findings=[FINDING], moved_by_findings=5.0), "lever arm"),
        (adjusted(model_findings=[{**FINDING, "moved_by": 0.6}] * 3, moved_by_findings=1.8), "lever arm"),
        (adjusted(strip_scatter=[SCATTER]), "boresight pitch varies between strips by 0.003 °"),
        (adjusted(restored_groups=[{"group": "control_points", "sigma0": 4.0}]), "σ of the control points"),
        (sigma0("image_points", 0.21), "σ of the image points are too large"),
        (sigma0("ins_attitudes", 1.8), "σ of the INS attitudes are too small"),
        (
            component("gnss_positions height", 1.6, 2.1),
            "σ of GNSS positions in height are too small: they are 1.83",
        ),
        (replace(GOOD, residuals=rejected("control_points", 4)), "4 of 50 control points"),
        (replace(GOOD, residuals=rejected("ins_attitudes", 50, 50)), "50 of 100 INS attitudes"),
        (
            replace(GOOD, residuals=contradicting("prior:boresight")),
            "Given values of boresight roll contradict",
        ),
        (checked(mean_m=[0.0, 0.04, 0.0]), "north at the independent check points have a mean"),
        (checked(rmse_m=[0.03, 0.03, 0.12]), "up at the independent check points have a root mean square"),
        (replace(GOOD, steps=compared(1e-5)), "contradict each other"),
        (
            replace(
                GOOD, gates=(GateResult(name="max_check_m_z", value=0.4, limit=0.2, unit="m", passed=False),)
            ),
            "The gate max_check_m_z failed: 0.4",
        ),
    ],
)
def test_every_kind_of_evidence_refuses_by_itself(evidence: Evidence, words: str) -> None:
    (reason,) = dict.fromkeys(evidence.objections(LIMITS)[0])
    assert words in reason
    assert evidence.objections(LIMITS)[1] == ()
    assert FlightVerdict().beside(*evidence.objections(LIMITS)).verdict == "refused"


@pytest.mark.parametrize(
    ("evidence", "words"),
    [
        (adjusted(model_findings=[{**FINDING, "moved_by": 0.4}], moved_by_findings=0.4), "lever arm"),
        (adjusted(strip_scatter=[{**SCATTER, "moved_by": 0.7}]), "boresight pitch"),
        (component("image_points", 0.20, 0.21), "σ of image points are too large"),
        (component("prior:gnss_strip_bias", 1.6, 3.0), "σ of the priors of GNSS strip bias are too small"),
        (replace(GOOD, residuals=most_of_a_strip()), "5 of 7 GNSS positions of strip 00"),
        (replace(GOOD, residuals=contradicting("prior:gnss_strip_bias")), "contradict the flight"),
        (replace(GOOD, mountings=("Camera C was not flown with one mounting.",)), "one mounting"),
    ],
)
def test_what_moves_nothing_by_much_restricts(evidence: Evidence, words: str) -> None:
    limits = LIMITS.model_copy(update={"rejected_part": 0.06})
    reasons, restrictions = evidence.objections(limits)
    assert reasons == ()
    assert words in restrictions[0]
    assert FlightVerdict().beside(reasons, restrictions).verdict == "restricted"


def test_a_given_value_that_contradicts_is_said_once_and_refuses_all_the_same() -> None:
    finding = {**FINDING, "quantity": "prior_boresight_roll", "entity": "UC:1", "moved_by": 0.4}
    table = contradicting("prior:boresight").replace("prior:boresight", "prior:boresight:UC:1")
    evidence = replace(adjusted(model_findings=[finding], moved_by_findings=0.4), residuals=table)
    assert evidence.objections(LIMITS) == ((FINDING["sentence"],), ())
    (other,) = replace(GOOD, residuals=table).objections(LIMITS)[0]
    assert other.startswith("Given values of boresight roll contradict the flight: they differ by")


def test_strips_whose_given_biases_contradict_are_counted_in_one_sentence() -> None:
    table = residuals()
    strips = table.index[table["group"] == "prior:gnss_strip_bias"]
    table.loc[strips, "group"] += [f":{k:02d}" for k in range(STRIPS)]
    table.loc[strips[:3], "standardized"] = [9.0, 8.0, -10.0]
    (sentence,) = replace(GOOD, residuals=table).objections(LIMITS)[1]
    assert "contradict the flight (3 of them): they differ by up to 0.01 m, 10.0 times" in sentence


def test_single_gross_errors_and_groups_that_say_little_are_no_evidence() -> None:
    assert replace(GOOD, residuals=rejected("control_points", 2)).objections(LIMITS) == ((), ())
    assert sigma0("control_points", 3.0, redundancy=5.0).objections(LIMITS) == ((), ())
    assert component("ins_attitudes yaw", 1.3, 2.5).objections(LIMITS) == ((), ())


def test_limits_are_those_of_the_project() -> None:
    wide = AcceptanceLimits(moved_sigmas=9.0, sigma0_factor=5.0, rejected_part=0.2)
    assert sigma0("image_points", 0.21).objections(wide) == ((), ())
    assert replace(GOOD, residuals=rejected("control_points", 4)).objections(wide) == ((), ())
    assert adjusted(model_findings=[FINDING], moved_by_findings=5.0).objections(wide)[0] == ()


def test_what_speaks_against_a_flight_stands_before_its_sigmas() -> None:
    weak = FlightVerdict(("focal_length is weak",), remarks=("a remark",))
    verdict = weak.beside(("the lever arm is wrong",), ())
    assert verdict.reasons == ("the lever arm is wrong", "focal_length is weak")
    assert verdict.remarks == ("a remark",)


@pytest.mark.parametrize("figure", ["mean_m", "rmse_m"])
def test_each_figure_of_check_points_has_a_sixth_of_the_error_probability(figure: str) -> None:
    """A mean to both sides in units of its σ, a root mean square of thirty errors to one."""
    probability = LIMITS.error_probability / 6.0
    limit = {
        "mean_m": 0.2 * stats.norm.isf(0.5 * probability),
        "rmse_m": np.sqrt(stats.chi2.isf(probability, 30) / 30.0),
    }[figure]
    good = {
        "rmse_m": [1.0] * 3,
        "predicted_rmse_m": [1.0] * 3,
        "degrees_of_freedom": [30.0] * 3,
        "mean_m": [0.0] * 3,
        "predicted_mean_sigma_m": [0.2] * 3,
    }
    for part, objections in ((0.999, 0), (1.001, 1)):
        found = checked(**(good | {figure: [*good[figure][:2], part * limit]}))
        assert len(found.objections(LIMITS)[0]) == objections


def test_good_check_points_are_objected_to_as_seldom_as_is_said() -> None:
    """Means and root mean squares along three axes are six tests, which share the probability."""
    random, points, trials = np.random.default_rng(4), 30, 600
    limits = AcceptanceLimits(error_probability=0.08)
    alone = replace(GOOD, residuals=residuals()[:0])  # nothing else can refuse, and is not counted 600 times
    refused = 0
    for _ in range(trials):
        found = random.standard_normal((points, 3))
        direct = {
            "rmse_m": np.sqrt(np.mean(found**2, axis=0)).tolist(),
            "predicted_rmse_m": [1.0] * 3,
            "degrees_of_freedom": [points] * 3,
            "mean_m": found.mean(axis=0).tolist(),
            "predicted_mean_sigma_m": [points**-0.5] * 3,
        }
        refused += bool(replace(alone, direct=direct).objections(limits)[0])
    low, high = stats.binom.interval(0.999, trials, limits.error_probability)
    assert 0.5 * low <= refused <= high
