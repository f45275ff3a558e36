"""The verdict in one sentence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np
import pandas as pd
import pytest

from tasks.documents.report.figures import gate_words
from tasks.documents.report.histogram import standardized_table
from tasks.documents.report.key_figures import Verdict, gate_table, rejection_note, verdict
from tasks.documents.report.material import Material
from tasks.documents.report.residual_tables import MOST_OF_GROUP, worst_table
from tasks.files.json_text import JSON
from tasks.quantities import group_words
from tasks.results.figures import AdjustmentFigures
from tasks.results.quality_gates import GateResult
from tasks.results.summary import summary_of
from tasks.settings.project import Project
from tasks.settings.quality import Gates
from tasks.store.notes import Notes

NOTHING = pd.DataFrame()
#: Heights of ten check points are nine times as far off as their σ let expect.
CHECK_POINTS: JSON = {
    "points": [10, 10, 10],
    "rmse_m": [0.02, 0.02, 0.9],
    "predicted_rmse_m": [0.02, 0.02, 0.1],
    "predicted_low_m": [0.01, 0.01, 0.05],
    "predicted_high_m": [0.03, 0.03, 0.15],
    "ratio": [1.0, 1.0, 9.0],
    "degrees_of_freedom": [10.0, 10.0, 10.0],
    "mean_m": [0.0, 0.0, 0.0],
    "mean_limit_m": [0.02, 0.02, 0.1],
    "confidence": 0.95,
    "over_limit": 6.0,
}


def _verdict(
    sigma0: float | None,
    limits: tuple[float, float] | None,
    gates: dict[str, object],
    factor: tuple[float | None, float | None] | None = None,
    others: Mapping[str, JSON] | None = None,
) -> Verdict:
    """The verdict on a block with this σ0, limits of the global test, gates and limits of a factor of σ."""
    lower, upper = limits or (None, None)
    passed = sigma0 is not None and limits is not None and limits[0] <= sigma0 <= limits[1]
    test: dict[str, JSON] = {"lower": lower, "upper": upper, "confidence": 0.95, "passed": passed}
    figures: dict[str, JSON] = {"sigma0": sigma0, "global_test": test, "rmse_check_m": [0.02, 0.03, 0.09]}
    figures |= others or {}
    if factor is not None:
        component = dict.fromkeys(("factor", "sigma", "redundancy", "degrees_of_freedom"), 1.0)
        component |= {"part": "ins_attitudes yaw", "estimated": factor[0] is not None, "unit": "deg"}
        component |= {"factor_lower": factor[0], "factor_upper": factor[1]}
        figures["variance_components"] = {"rounds": 2, "confidence": 0.99, "components": [component]}
    summary = summary_of([Notes((), figures)], Gates.model_validate(gates), {})
    project = Project.model_construct()
    return verdict(Material(project, summary, {}, *[NOTHING] * 15))


@pytest.mark.parametrize(
    ("value", "limit", "bound", "shown"),
    [
        (0.0504, 0.05, "max", ("0.0504", "0.0500")),
        (0.05, 0.05, "max", ("0.050", "0.050")),
        (0.02, 0.0005, "min", ("0.0200", "0.0005")),
        (0.0004, 0.001, "min", ("0.000", "0.001")),
        (None, 0.0025, "max", ("–", "0.0025")),
        (0.0, 0.0, "max", ("0", "0")),
        (2.0, 0.0, "max", ("2", "0")),
        (1.012, 1.0, "max", ("1.012", "1.000")),
    ],
)
def test_a_limit_is_shown_whole_and_a_value_beyond_it_never_as_the_limit(
    value: float | None, limit: float, bound: Literal["max", "min"], shown: tuple[str, str]
) -> None:
    kept = value is not None and (value <= limit if bound == "max" else value >= limit)
    gate = GateResult(name="sigma0", value=value, limit=limit, unit="1", bound=bound, passed=kept)
    (row,) = gate_table([gate]).rows
    assert (str(row.cells[1]), str(row.cells[3])) == shown


LIMITS = (0.98, 1.02)
CHECK = {"rmse_check_m": {"max": [0.05, 0.05, 0.05]}}


@pytest.mark.parametrize(
    ("sigma0", "limits", "gates", "tone", "words"),
    [
        (1.0, LIMITS, {}, "good", "The block is adjusted, and the residuals agree"),
        (
            1.0,
            LIMITS,
            {"sigma0": {"max": 1.2}},
            "good",
            "the only limit passed, and the residuals agree",
        ),
        (
            1.1,
            LIMITS,
            {"sigma0": {"min": 0.8, "max": 1.2}},
            "attention",
            "all 2 limits passed, but the residuals are larger",
        ),
        (
            0.9,
            LIMITS,
            {},
            "attention",
            "but the residuals are smaller than expected from the stated σ (σ0 = 0.9",
        ),
        (None, None, {}, "attention", "but nothing could be tested because the block has no redundancy"),
        (1.3, LIMITS, {"sigma0": {"max": 1.2}}, "failed", "but the only limit failed (σ0)"),
        (1.0, LIMITS, CHECK, "failed", "but 1 of 3 limits failed (RMS at check points, z)"),
        (1.0, LIMITS, {"max_check_m": {"max": 1.0}}, "failed", "but 3 of 3 limits failed"),
    ],
)
def test_the_verdict_names_limits_and_global_test(
    sigma0: float | None, limits: tuple[float, float] | None, gates: dict[str, object], tone: str, words: str
) -> None:
    found = _verdict(sigma0, limits, gates)
    assert found.tone == tone
    assert words in found.sentence
    assert found.sentence.startswith("The block is adjusted")
    assert found.sentence.endswith(".")


@pytest.mark.parametrize(
    ("factor", "sigma0", "words"),
    [
        ((1.02, 1.16), 1.0, "agree with the estimated σ, not with all stated ones (σ0 = 1.000"),
        ((0.4, 0.9), 1.0, "agree with the estimated σ, not with all stated ones"),
        ((0.9, 1.1), 1.0, "agree with the stated σ"),
        ((None, None), 1.0, "agree with the stated σ"),
        ((1.02, 1.16), 1.1, "larger than expected from the estimated σ"),
        ((0.9, 1.1), 1.1, "larger than expected from the stated σ"),
    ],
)
def test_a_stated_sigma_that_was_replaced_is_not_said_to_agree(
    factor: tuple[float | None, float | None], sigma0: float, words: str
) -> None:
    assert words in _verdict(sigma0, LIMITS, {}, factor).sentence


def test_check_points_beyond_their_limits_stand_against_residuals_that_agree() -> None:
    missed = {"check_point_test": CHECK_POINTS}
    assert (
        "but the check points are beyond their limits, although the residuals agree"
        in _verdict(1.0, (0.96, 1.04), {}, others=missed).sentence
    )
    assert (
        "but the check points are beyond their limits, and the residuals are larger"
        in _verdict(1.2, (0.96, 1.04), {}, others=missed).sentence
    )


def test_what_was_kept_is_not_said_to_be_rejected() -> None:
    none, some = AdjustmentFigures(), AdjustmentFigures(critical_value=4.13, rejected_per_pass=(3, 1))
    assert rejection_note(none) == "Nothing was rejected: rejection is off (adjustment.rejection)."
    assert (
        rejection_note(some) == "Observations with |w| above 4.13 were rejected; rejected in each pass: 3, 1."
    )
    kept = some.model_copy(update={"inseparable_control": ("A", "B"), "rejected_per_pass": ()})
    assert rejection_note(kept) == (
        "Observations with |w| above 4.13 were rejected, except what control points that contradict each "
        "other explain; rejected in each pass: none."
    )


def test_limits_and_groups_are_named_for_people() -> None:
    assert gate_words("max_check_m_z") == "largest difference at check points, z"
    assert gate_words("something_new") == "something new"
    assert group_words("gnss_positions") == "GNSS positions"
    assert group_words("prior:gnss_strip_bias") == "priors: GNSS strip bias"
    assert group_words("prior:gnss_strip_bias:N_01:f") == "priors: GNSS strip bias, N_01:f"
    assert group_words("distances:P_2") == "distances, P_2"


def test_priors_of_many_strips_are_one_group() -> None:
    residuals = pd.DataFrame(
        {
            "group": [f"prior:gnss_strip_bias:S{strip}" for strip in range(20)] + ["gnss_positions"] * 4,
            "standardized": np.arange(24.0),
            "status": "used",
            "image": None,
            "point": None,
            "component": "x",
            "residual": 0.1,
            "sigma": 0.1,
            "unit": "m",
        }
    )
    material = Material(
        Project.model_construct(), summary_of([Notes((), {})], Gates(), {}), {}, *[NOTHING] * 15
    )
    material = replace(material, residuals=residuals)
    vars(material)["oriented"] = pd.DataFrame({"image": [], "strip": []})
    counted = [(row.key, row.cells[1].value) for row in standardized_table(material).rows[:-1]]
    assert counted == [("prior:gnss_strip_bias", 20.0), ("gnss_positions", 4.0)]
    assert len(worst_table(material).rows) == MOST_OF_GROUP + 4
