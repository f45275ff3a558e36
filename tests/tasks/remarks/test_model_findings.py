"""What tests of the model have found, in words: every alternative that is tested has its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from flows.runs.project_run import RunRequest, carry_out
from tasks.evaluation.alternative_words import POWER, alternative_words
from tasks.evaluation.model_test_tables import ERROR_PROBABILITY
from tasks.quantities import shown
from tasks.remarks.model_findings import model_findings
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.flows.adjustment_alone import adjustment_alone


def row(quantity: str, rank: int, explained: float, **changed: object) -> dict[str, object]:
    return {
        "quantity": quantity,
        "entity": "UCE",
        "scope": "all",
        "part": "",
        "unit": "m",
        "explained": explained,
        "explained_sigma": 0.01,
        "t": explained / 0.01,
        "sigma": 0.01,
        "detectable": 0.01 * (4.3 + POWER),
        "rank": rank,
        "alike": None,
        "moves": "gnss_shift_z",
        "moves_entity": "1",
        "moved_by_estimate": abs(explained) * 10.0,
        **changed,
    }


def test_axes_of_one_thing_are_one_cause_and_the_likeliest_comes_first() -> None:
    found = model_findings(
        pd.DataFrame(
            [
                row("time_offset", 2, 0.010, unit="s", explained_sigma=0.0001, entity="1"),
                row("lever_arm_x", 1, 0.70),
                row("lever_arm_z", 3, -2.40),
                row("boresight_yaw", 0, 0.1, unit="deg"),
            ]
        )
    )
    assert [item.quantity for item in found] == ["lever_arm", "time_offset"]
    assert [item.rank for item in found] == [1, 2]
    assert "x +0.7 ± 0.01 m, z −2.4 ± 0.01 m" in found[0].sentence
    assert "The result is affected: GNSS shift z of flight 1 is off by 24.0 times its σ." in found[0].sentence
    assert "+10 ± 0.1 ms" in found[1].sentence


def test_a_finding_that_later_ones_explain_in_part_states_both_statistics() -> None:
    rows = [
        row("lever_arm_x", 1, 0.008, t=9.0),
        row("time_offset", 2, 0.010, unit="s", explained_sigma=0.0001),
    ]
    first, second = model_findings(pd.DataFrame(rows))
    assert "(t = 9.0 alone, 0.8 with the other findings, critical value 4.3)" in first.sentence
    assert "(t = 100.0, critical value" in second.sentence


def test_a_wrong_place_is_said_in_directions() -> None:
    rows = [
        row("control_point_x", 1, -0.375, entity="C051"),
        row("control_point_z", 2, 0.25, entity="C051"),
        row("gnss_shift_y", 3, -0.1, entity="1", scope="strip", part="E03"),
    ]
    point, strip = model_findings(pd.DataFrame(rows))
    assert point.sentence.startswith(
        "The given coordinates of control point C051 are 0.375 ± 0.01 m too far west, 0.25 ± 0.01 m too high "
        "(computed − given x +0.375, z −0.25 m) (t = 37.5, critical value 4.3)"
    )
    assert strip.sentence.startswith("The GNSS positions in strip E03 are 0.1 ± 0.01 m too far south ")


def test_each_given_value_that_contradicts_is_a_cause_of_its_own() -> None:
    rows = [
        row("prior_principal_point_x", 1, 0.147, unit="mm", entity="UCE", explained_sigma=0.004),
        row("prior_gnss_strip_bias_y", 2, -0.3, entity="E03"),
    ]
    camera, strip = model_findings(pd.DataFrame(rows))
    assert camera.sentence.startswith(
        "The given principal point x of UCE contradicts the block: it looks wrong by +147 ± 4 µm (t = 36.8"
    )
    assert "Check the value and its σ (adjustment.priors" in camera.sentence
    assert strip.sentence.startswith("The given GNSS strip bias y of strip E03 contradicts the block: ")


def test_a_finding_stands_beside_the_likeliest_that_is_none() -> None:
    rows = [
        row("control_point_z", 1, 0.25, entity="C051"),
        row("boresight_roll", 0, -0.02, unit="deg", scope="strip", part="E03"),
        row("gnss_shift_y", 0, 0.01, entity="1"),
    ]
    (found,) = model_findings(pd.DataFrame(rows))
    words = "(t = 25.0, critical value 4.3; next: boresight roll in strip E03 of UCE with t = 2.0)"
    assert words in found.sentence


def test_an_attitude_is_said_as_computed_minus_given() -> None:
    (found,) = model_findings(pd.DataFrame([row("ins_attitude_roll", 1, 0.2, unit="deg", entity="E03_004")]))
    assert "does not fit: computed − given roll −0.2 ± 0.01°" in found.sentence


def test_rejection_is_advised_only_where_nothing_is_rejected() -> None:
    rows = pd.DataFrame([row("gnss_position_x", 1, 0.2, entity="E03_004")])
    (found,) = model_findings(rows)
    assert found.sentence.endswith("its solution, or reject gross errors (adjustment.rejection).")
    (found,) = model_findings(rows, rejecting=True)
    assert found.sentence.endswith("Check its time and its solution.")


@pytest.mark.parametrize("rejecting", [False, True])
@pytest.mark.parametrize(
    ("alike", "others"),
    [
        ("control scale, control point z of C049", ("C049",)),
        ("control height scale, control point x of C001", ()),
    ],
)
def test_rejection_is_not_advised_where_it_cannot_tell_which_control_point_is_wrong(
    alike: str, others: tuple[str, ...], rejecting: bool
) -> None:
    rows = pd.DataFrame([row("control_point_z", 1, 3.79, entity="C001", alike=alike)])
    (found,) = model_findings(rows, rejecting=rejecting)
    assert ("or reject gross errors (adjustment.rejection)" in found.sentence) == (
        not others and not rejecting
    )
    assert ("cannot determine which of them is wrong" in found.sentence) == (bool(others) and not rejecting)
    assert found.alike_points == others


def test_the_same_thing_in_two_strips_is_two_causes() -> None:
    rows = [
        row("boresight_roll", k + 1, 0.02, unit="deg", scope="strip", part=f"E0{k}", explained_sigma=0.001)
        for k in (0, 1)
    ]
    first, second = model_findings(pd.DataFrame(rows))
    assert "in strip E00: roll +0.02 ± 0.001°" in first.sentence
    assert "in strip E01" in second.sentence
    assert alternative_words(rows[0]) == "boresight roll in strip E00"


def test_what_would_look_the_same_is_named_beside_it() -> None:
    rows = [
        row("time_offset", 1, 0.002, unit="s", entity="1", alike="lever arm x, principal point x"),
        row("lever_arm_x", 2, 0.1, alike="lever arm y"),
        row("lever_arm_y", 3, 0.1, alike=None),
    ]
    time, arm = model_findings(pd.DataFrame(rows))
    assert "Nearly indistinguishable from it: lever arm x, principal point x." in time.sentence
    assert "Nearly indistinguishable" not in arm.sentence


@pytest.mark.parametrize(("size", "north"), [(0.013, False), (-0.98, True), (0.29, True)])
def test_a_small_part_of_the_other_north_is_not_called_the_other_north(size: float, north: bool) -> None:
    alike = "boresight yaw"
    found = model_findings(pd.DataFrame([row("convergence", 1, size, unit="1", entity="", alike=alike)]))
    assert ("appear to refer to the other north" in found[0].sentence) == north
    assert ("Check angles.reference" in found[0].sentence) == north
    assert ("An error looks like +1.3 ± 1 % of the angle" in found[0].sentence) != north


def test_components_of_one_thing_in_a_strip_are_not_named_beside_each_other() -> None:
    of_strip = {"unit": "m/s", "entity": "", "scope": "strip", "part": "E03"}
    alike = "GNSS drift y in strip E03, INS drift pitch in strip E03"
    rows = [
        row("gnss_drift_x", 1, 0.1, alike=alike, **of_strip),
        row("gnss_drift_y", 2, 0.1, **of_strip),
    ]
    (drift,) = model_findings(pd.DataFrame(rows))
    assert "Nearly indistinguishable from it: INS drift pitch in strip E03." in drift.sentence


def test_nothing_significant_is_no_finding() -> None:
    assert model_findings(pd.DataFrame([row("lever_arm_x", 0, 0.01)])) == ()


@pytest.fixture(scope="module")
def tested(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    """Every alternative of a small block at two heights."""
    folder = tmp_path_factory.mktemp("block")
    project = simulate_project(load_simulation("uce-calibration", ("points.count=600", *CHANGES)), folder)
    outcome = carry_out(adjustment_alone, RunRequest(project.project_file, None, ()))
    assert outcome.error is None, outcome.error
    return pd.read_parquet(Path(outcome.directory) / "model_alternatives.parquet")


CHANGES = (
    "points.detection=0.6",
    "flight.0.lines=2",
    "flight.0.exposures=6",
    "flight.1.lines=2",
    "flight.1.exposures=5",
    "flight.2.exposures=4",
    "flight.3.exposures=4",
    "control.0.extent_m=[1500.0, 1200.0]",
)


def test_every_alternative_has_words_a_unit_and_a_remedy_of_its_own(tested: pd.DataFrame) -> None:
    kinds = {str(name) for name in tested["quantity"]}
    assert {"lever_arm_x", "time_offset", "refraction", "control_shift_z", "gnss_height_scale"} <= kinds
    assert {"boresight_yaw", "focal_length", "gnss_shift_z", "brown:K1", "control_turn"} <= kinds
    assert set(tested["scope"]) == {"all", "height", "direction", "strip"}
    for quantity, own in tested[tested["t"].notna()].groupby("quantity"):
        chosen = own.head(1).assign(rank=1, explained=own["estimate"], explained_sigma=own["sigma"])
        (finding,) = model_findings(chosen)
        image_error = "systematic errors that no estimated parameter describes" in finding.sentence
        assert image_error == str(quantity).startswith("brown")
        assert "{" not in finding.sentence
        assert finding.sentence.endswith((".", ")"))
        assert shown(str(own["unit"].iloc[0])).factor > 0.0


def test_the_graver_an_unnoticed_error_the_sooner_it_is_significant(tested: pd.DataFrame) -> None:
    """All critical values together keep the probability of a false alarm."""
    known = tested[tested["t"].notna()]
    critical = known["detectable"] / known["sigma"] - stats.norm.ppf(0.8)
    assert 2.0 * stats.norm.sf(critical).sum() == pytest.approx(ERROR_PROBABILITY)
    moved_by_sigma = known["moved_by_detectable"] / (known["detectable"] / known["sigma"])
    order = np.argsort(moved_by_sigma.to_numpy())
    assert (np.diff(critical.to_numpy()[order]) < 1e-9).all()
    assert 3.0 < critical.min() < critical.max() - 0.3
    assert critical.max() < 5.5


def test_what_cannot_be_told_has_no_numbers_but_says_what_it_moves(tested: pd.DataFrame) -> None:
    shift = tested[tested["quantity"] == "control_shift_z"].iloc[0]
    assert pd.isna(shift["t"])
    assert pd.isna(shift["detectable"])
    assert shift["moves"] == "gnss_shift_z"


def test_what_moves_nothing_says_nothing_of_the_result_and_says_what_to_free() -> None:
    nothing = {"moves": None, "moves_entity": None, "moved_by_estimate": 0.0}
    whole = row("boresight_roll", 1, 0.1, unit="deg", **nothing)
    strip = row("boresight_roll", 2, 0.2, unit="deg", scope="strip", part="s1", **nothing)
    found = model_findings(pd.DataFrame([whole, strip]))
    assert not any("nan" in one.sentence or "The result is affected" in one.sentence for one in found)
    assert [one.moves for one in found] == ["", ""]
    assert ["free boresight" in one.sentence for one in found] == [True, False]


def test_large_sizes_have_no_powers_of_ten() -> None:
    (found,) = model_findings(pd.DataFrame([row("refraction", 1, 22.4, unit="1", explained_sigma=1.3)]))
    assert "+2,240 ± 130 %" in found.sentence
