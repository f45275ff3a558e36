"""Weak modes in words: the pair or the combination, and what would separate it."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.parameters import Quantity
from tasks.evaluation.adjustment_figures import weak_parameters
from tasks.remarks.separability import determining, weak_parameter_sentences
from tasks.results.figures import WeakParameters


def parameters(*names: str) -> tuple[Quantity, ...]:
    return tuple(
        Quantity(name, flight="1") if "gnss" in name else Quantity(name, camera="C") for name in names
    )


def sentences(names: tuple[Quantity, ...], matrix: np.ndarray) -> list[str]:
    return weak_parameter_sentences(weak_parameters(names, matrix))


def correlation(size: int, **pairs: float) -> np.ndarray:
    matrix = np.eye(size)
    for key, value in pairs.items():
        a, b = (int(text) for text in key[1:].split("_"))
        matrix[a, b] = matrix[b, a] = value
    return matrix


@pytest.mark.parametrize(
    ("names", "remedy"),
    [
        (("focal_length", "gnss_shift_z"), "a second flying height or strong relief separates them"),
        (("principal_point_x", "gnss_shift_y"), "strips flown in opposite or crossing directions separate"),
        (("lever_arm_y", "principal_point_y"), "a second flying height or strong relief separates"),
        (("lever_arm_z", "gnss_shift_z"), "strong tilts alone separate them"),
        (
            ("lever_arm_x", "time_offset"),
            "delivered rates of the body or varying ground speeds separate them",
        ),
        (("gnss_shift_x", "lever_arm_x"), "strips flown in opposite or crossing directions separate"),
        (("boresight_yaw", "lever_arm_x"), "hold one of them fixed or give it a prior"),
    ],
)
def test_a_correlated_pair_comes_with_what_separates_it(names: tuple[str, str], remedy: str) -> None:
    (sentence,) = sentences(parameters(*names), correlation(2, p0_1=-0.993))
    assert str(parameters(*names)[0]) in sentence
    assert str(parameters(*names)[1]) in sentence
    assert "are 99.3 % correlated" in sentence
    assert remedy in sentence


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("gnss_shift_z", "control"),
        ("boresight_yaw", "attitudes"),
        ("principal_point_y", "strips flown in opposite or crossing directions"),
        ("focal_length", "a second flying height or strong relief"),
        ("lever_arm_x", "strips flown in opposite or crossing directions"),
        ("lever_arm_z", "strong tilts"),
        ("time_offset", "varying ground speeds"),
    ],
)
def test_a_parameter_that_is_not_determined_comes_with_what_it_needs(name: str, remedy: str) -> None:
    (found,) = determining(name)
    assert remedy in found


def test_what_separates_a_combination_is_listed() -> None:
    names = ("principal_point_x", "gnss_shift_x", "lever_arm_x")
    (sentence,) = weak_parameter_sentences((WeakParameters(parameters=names, entities=("C", "1", "C")),))
    assert (
        "strips flown in opposite or crossing directions and a second flying height or strong relief "
        "separate them, otherwise hold all but one of them fixed"
    ) in sentence


def test_nearly_complete_correlation_is_never_said_to_be_complete() -> None:
    (sentence,) = sentences(parameters("focal_length", "lever_arm_z"), correlation(2, p0_1=0.9999999))
    assert "99.99 % correlated" in sentence


def test_three_parameters_that_only_together_are_weak_are_named_together() -> None:
    """No pair above 0.98, and yet x + y + z is hardly determined."""
    free = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]])
    covariance = free @ free.T + 0.004 * np.eye(3)
    scale = 1.0 / np.sqrt(np.diagonal(covariance))
    matrix = covariance * np.outer(scale, scale)
    assert np.abs(matrix - np.eye(3)).max() < 0.98
    (sentence,) = sentences(parameters("gnss_shift_x", "principal_point_x", "lever_arm_x"), matrix)
    assert "are hardly determined individually" in sentence
    assert "strips flown in opposite or crossing directions and a second flying height" in sentence
    assert "hold all but one" in sentence


def test_separated_parameters_give_no_sentence() -> None:
    assert sentences(parameters("focal_length", "gnss_shift_z"), correlation(2, p0_1=0.9)) == []
    assert sentences(parameters("focal_length"), np.eye(1)) == []
    assert sentences((), np.zeros((0, 0))) == []


def of_heads() -> tuple[tuple[Quantity, ...], np.ndarray]:
    """Roll and yaw of four heads, which have the errors of the platform in common."""
    names = tuple(
        Quantity(f"relative_rotation_{axis}", camera=f"H{k}") for axis in ("roll", "yaw") for k in range(4)
    )
    common = np.kron(np.eye(2), np.ones((4, 4)))
    return names, 0.991 * common + 0.009 * np.eye(8)


def test_what_many_parameters_have_in_common_is_one_sentence() -> None:
    roll, yaw = sentences(*of_heads())
    for axis, sentence in (("roll", roll), ("yaw", yaw)):
        assert all(f"relative_rotation_{axis} of H{k}" in sentence for k in range(4))
        assert "are up to 99.1 % correlated" in sentence


def test_heads_are_not_said_to_be_hardly_separable_as_their_differences_are_well_known() -> None:
    for sentence in sentences(*of_heads()):
        assert "separate them" not in sentence
        assert "held" not in sentence
        assert "against each other" in sentence


def test_what_a_calibration_has_determined_is_left_to_its_verdict() -> None:
    names, matrix = of_heads()
    found = weak_parameters(names, matrix)
    rolls = {(item.name, item.entity) for item in names[:4]}
    (yaw,) = weak_parameter_sentences(found, determined=rolls)
    assert "relative_rotation_yaw of H0" in yaw
    combination = WeakParameters(
        parameters=("gnss_shift_x", "principal_point_x", "lever_arm_x"), entities=("1", "C", "C")
    )
    members = set(zip(combination.parameters, combination.entities, strict=True))
    (sentence,) = weak_parameter_sentences((combination,), determined=members)
    assert "although all are determined: use their values together only." in sentence
    assert "hardly" not in sentence


def test_two_determined_parameters_of_a_combination_are_both() -> None:
    pair = WeakParameters(parameters=("principal_point_x",) * 2, entities=("left", "right"))
    members = set(zip(pair.parameters, pair.entities, strict=True))
    (sentence,) = weak_parameter_sentences((pair,), determined=members)
    assert "although both are determined" in sentence
