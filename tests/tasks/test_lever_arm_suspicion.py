"""A lever arm given with a wrong sign is named; anything else is not."""

from __future__ import annotations

import numpy as np
import pytest

from tasks.plausibility.lever_arm import lever_arm_suspicion

TRUE = np.array([0.61, 0.34, -1.20])
SIGMA = np.full(3, 0.01)


@pytest.mark.parametrize(
    ("signs", "words"),
    [
        ((-1, -1, -1), "in all three components"),
        ((1, 1, -1), "along down"),
        ((1, -1, 1), "along right"),
        ((-1, -1, 1), "along forward and right"),
    ],
)
def test_wrong_signs_are_named(signs, words: str) -> None:
    found = TRUE + np.array([0.03, -0.02, 0.04])
    sentence = lever_arm_suspicion(TRUE * np.array(signs), found, SIGMA, "C")
    assert sentence is not None
    assert f"wrong sign {words}:" in sentence
    assert "(+0.64, +0.32, -1.16) m found" in sentence


def test_a_right_lever_arm_raises_no_suspicion() -> None:
    assert lever_arm_suspicion(TRUE, TRUE + 0.04, SIGMA, "C") is None


def test_a_lever_arm_that_is_wrong_otherwise_is_not_called_a_sign() -> None:
    assert lever_arm_suspicion(np.array([2.0, 1.0, 0.0]), TRUE, SIGMA, "C") is None


def test_no_given_lever_arm_has_no_sign() -> None:
    assert lever_arm_suspicion(np.zeros(3), TRUE, SIGMA, "C") is None


def test_what_is_not_determined_proves_nothing() -> None:
    assert lever_arm_suspicion(-TRUE, TRUE, np.full(3, 1.0), "C") is None


def test_a_component_that_is_not_determined_takes_no_part() -> None:
    """Its sign is not judged, and it does not keep that of the others from being judged."""
    found = np.array([0.61, 0.34, 55.0])
    sentence = lever_arm_suspicion(-TRUE, found, np.array([0.02, 0.02, 60.0]), "C")
    assert sentence is not None
    assert "wrong sign along forward and right:" in sentence
    assert "(+0.61, +0.34, ?) m found" in sentence
    assert "? cannot be separated from a GNSS shift" in sentence


def test_each_component_is_judged_by_its_own_standard_deviation() -> None:
    """A large uncertainty in height does not hide a sign in plan."""
    given, found = np.array([0.35, 0.12, -1.20]), np.array([0.35, -0.12, -1.40])
    sentence = lever_arm_suspicion(given, found, np.array([0.02, 0.02, 0.25]), "C")
    assert sentence is not None
    assert "wrong sign along right:" in sentence
