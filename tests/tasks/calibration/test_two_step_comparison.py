"""One-step against two-step calibration: the test by hand, what contradicts, and what cannot be compared."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from tasks.calibration.two_step_comparison import compared_steps, images_of_mountings, several_mountings
from tasks.errors import InputError

CAMERA, FLIGHT = "UCE", "1"
ROLL, PITCH, EAST = ("boresight_roll", CAMERA), ("boresight_pitch", CAMERA), ("gnss_shift_x", FLIGHT)


def parameters(*rows: tuple[tuple[str, str], float, float]) -> pd.DataFrame:
    return pd.DataFrame(
        [
            {"parameter": key[0], "entity": key[1], "unit": "m", "value": value, "sigma": sigma}
            for key, value, sigma in rows
        ]
    )


def correlations(*rows: tuple[tuple[str, str], tuple[str, str], float]) -> pd.DataFrame:
    columns = ["parameter_a", "entity_a", "parameter_b", "entity_b", "correlation"]
    return pd.DataFrame([(*one, *other, value) for one, other, value in rows], columns=columns)


def means(
    *rows: tuple[str, float, float],
    scope: str = "mounting",
    group: str = "0",
    camera: str = CAMERA,
    freedom: float = np.inf,
) -> pd.DataFrame:
    return pd.DataFrame(
        [
            {
                "camera": camera,
                "scope": scope,
                "group": group,
                "component": name,
                "value": value,
                "sigma": sigma,
                "freedom": freedom,
            }
            for name, value, sigma in rows
        ]
    )


BOTH = parameters((ROLL, 1.0, 0.3), (PITCH, 2.0, 0.4))
CORRELATED = correlations((ROLL, PITCH, 0.5))


def test_the_statistic_is_that_of_the_sum_of_both_covariances() -> None:
    found = compared_steps(BOTH, CORRELATED, means(("roll", 1.2, 0.4), ("pitch", 1.5, 0.3)))
    assert found is not None
    covariance = np.array([[0.09 + 0.16, 0.5 * 0.12], [0.5 * 0.12, 0.16 + 0.09]])
    difference = np.array([-0.2, 0.5])
    assert [item.difference for item in found.parameters] == pytest.approx(difference.tolist())
    assert found.parameters[0].t == pytest.approx(-0.2 / 0.5)
    assert found.chi_squared == pytest.approx(difference @ np.linalg.inv(covariance) @ difference)
    assert found.freedom == 2
    assert found.probability == pytest.approx(stats.chi2.sf(found.chi_squared, 2))
    assert "agree" in found.sentence


def test_a_contradiction_is_called_one_and_names_the_largest() -> None:
    found = compared_steps(BOTH, CORRELATED, means(("roll", 1.1, 0.4), ("pitch", 4.5, 0.3)))
    assert found is not None
    assert found.probability < 0.01
    assert "contradict each other" in found.sentence
    assert "boresight_pitch of UCE, 5.0 σ" in found.sentence


def test_few_strips_count_with_students_quantile() -> None:
    found = compared_steps(BOTH, CORRELATED, means(("roll", 1.2, 0.4), freedom=3.0))
    assert found is not None
    wide = 0.4 * stats.t.ppf(0.9995, 3) / stats.norm.ppf(0.9995)
    assert found.parameters[0].t == pytest.approx(-0.2 / np.hypot(0.3, wide))
    assert found.parameters[0].two_step_sigma == 0.4


@pytest.mark.parametrize("trials", [300, pytest.param(1_000, marks=pytest.mark.slow)])
def test_false_alarms_come_as_often_as_stated_where_the_two_are_independent(trials: int) -> None:
    """At any level: all probabilities are as often below it as it says."""
    random, probabilities = np.random.default_rng(3), list[float]()
    covariance = np.array([[0.09, 0.06], [0.06, 0.16]])
    for _ in range(trials):
        one, two = random.multivariate_normal([0.0, 0.0], covariance), random.normal(0.0, [0.4, 0.3])
        found = compared_steps(
            parameters((ROLL, one[0], 0.3), (PITCH, one[1], 0.4)),
            CORRELATED,
            means(("roll", two[0], 0.4), ("pitch", two[1], 0.3)),
        )
        assert found is not None
        probabilities.append(found.probability)
    assert stats.kstest(probabilities, "uniform").pvalue > 1e-3
    assert np.sum(np.array(probabilities) < 0.01) <= stats.binom.ppf(0.999, len(probabilities), 0.01)


def test_a_shift_is_compared_with_the_means_of_its_own_flight() -> None:
    second = ("gnss_shift_x", "2")
    shifts = parameters((EAST, 0.1, 0.01), (second, 0.3, 0.01))
    of_flights = pd.concat(
        [
            means(("east", 0.12, 0.01), scope="flight", group="1"),
            means(("east", 0.29, 0.01), scope="flight", group="2"),
            means(("east", 0.2, 0.01)),
        ]
    )
    found = compared_steps(shifts, correlations((EAST, second, 0.0)), of_flights)
    assert found is not None
    assert [item.two_step for item in found.parameters] == [0.12, 0.29]


def test_the_mounting_of_the_one_step_images_is_compared() -> None:
    """Twenty images of the second mounting: the main one is that of other strips."""
    two = pd.concat([means(("roll", 5.0, 0.4)), means(("roll", 1.2, 0.4), group="1")])
    found = compared_steps(BOTH, CORRELATED, two, {CAMERA: {1: 20}})
    assert found is not None
    assert [item.two_step for item in found.parameters] == [1.2]


def test_that_there_is_not_one_mounting_is_said() -> None:
    differences = pd.DataFrame(
        {"image": ["a", "b", "c", "d"], "camera": CAMERA, "mounting": [0, 1, 1, 0], "roll_deg": 0.0}
    )
    counted = images_of_mountings(differences, pd.DataFrame({"image": ["a", "b", "c"]}))
    assert counted == {CAMERA: {1: 2, 0: 1}}
    two = pd.concat([means(("roll", 5.0, 0.4)), means(("roll", 1.2, 0.4), group="1")])
    found = compared_steps(BOTH, CORRELATED, two, counted)
    assert found is not None
    assert [item.two_step for item in found.parameters] == [1.2]
    (said,) = several_mountings(counted)
    assert "compared with mounting 1 (2 of 3 images)" in said
    assert said not in found.sentence


def test_shift_and_lever_arm_that_are_free_together_are_not_compared() -> None:
    """The second step sees their sum."""
    both = parameters((EAST, 0.1, 0.01), (("lever_arm_x", CAMERA), 0.2, 0.01))
    two = means(("east", 0.3, 0.01), ("forward", 0.3, 0.01))
    assert compared_steps(both, correlations((EAST, ("lever_arm_x", CAMERA), 0.0)), two) is None


def test_held_parameters_and_means_without_a_sigma_are_not_compared() -> None:
    held = parameters((ROLL, 1.0, np.nan), (PITCH, 2.0, 0.4))
    assert compared_steps(held, CORRELATED, means(("roll", 1.0, 0.1), ("pitch", 2.0, np.nan))) is None


def test_tables_of_two_runs_are_refused() -> None:
    with pytest.raises(InputError, match="gives no correlation of boresight_pitch"):
        compared_steps(BOTH, correlations(), means(("roll", 1.2, 0.4), ("pitch", 1.5, 0.3)))
