"""What is held enters every σ and correlation of a calibration by the formula, and nothing else."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tasks.calibration.held_quantities import held_sigmas, with_held
from tasks.settings.calibration import HeldSigmas

KEYS = (("gnss_shift_z", "1"), ("focal_length", "UCE"), ("gnss_strip_bias_z", "E01"))
FORMAL = np.array([0.010, 0.0006, 0.02])
CORRELATION = np.array([[1.0, -0.9, 0.1], [-0.9, 1.0, 0.0], [0.1, 0.0, 1.0]])
#: Of |t|, two-sided 95 % of many degrees of freedom.
LIMIT = 1.96
EFFECTS = {("lever_arm_z", "UCE", "m"): (-0.95, 0.001), ("refraction", "", "1"): (0.1, -0.004)}


def parameters() -> pd.DataFrame:
    return pd.DataFrame(
        {
            "parameter": [*(name for name, _ in KEYS), "lever_arm_z"],
            "entity": [*(entity for _, entity in KEYS), "UCE"],
            "change": [0.3, -0.008, 0.01, 0.0],
            "sigma": [*FORMAL, np.nan],
            "t": [30.0, -13.0, 0.5, np.nan],
            "status": ["significant", "significant", "not_significant", "fixed"],
        }
    )


def correlations(matrix: np.ndarray = CORRELATION) -> pd.DataFrame:
    first, second = np.triu_indices(3, 1)
    return pd.DataFrame(
        {
            "parameter_a": [KEYS[i][0] for i in first],
            "entity_a": [KEYS[i][1] for i in first],
            "parameter_b": [KEYS[i][0] for i in second],
            "entity_b": [KEYS[i][1] for i in second],
            "correlation": matrix[first, second],
        }
    )


def effects(scope: str = "all") -> pd.DataFrame:
    """Those of quantities that are held; of a strip's parameter nothing is said."""
    rows = [
        {
            "quantity": quantity,
            "entity": entity,
            "unit": unit,
            "scope": scope,
            "part": "",
            "parameter": KEYS[k][0],
            "parameter_entity": KEYS[k][1],
            "effect": effect,
        }
        for (quantity, entity, unit), values in EFFECTS.items()
        for k, effect in enumerate(values)
    ]
    return pd.DataFrame(rows)


def test_the_covariance_is_the_formal_one_and_the_squares_of_what_is_held() -> None:
    sigmas = {"lever_arm_z": 0.01, "refraction": 0.05, "time_offset": 0.0002}
    found = with_held(parameters(), correlations(), effects(), sigmas, LIMIT)
    expected = CORRELATION * np.outer(FORMAL, FORMAL)
    for (quantity, _, _), values in EFFECTS.items():
        share = sigmas[quantity] * np.array([*values, 0.0])
        expected += np.outer(share, share)
    spread = np.sqrt(np.diagonal(expected))
    np.testing.assert_allclose(found.parameters["sigma"][:3], spread, rtol=1e-12)
    assert np.isnan(found.parameters["sigma"].iloc[3])
    np.testing.assert_allclose(
        found.correlations["correlation"],
        (expected / np.outer(spread, spread))[np.triu_indices(3, 1)],
        rtol=1e-12,
    )
    np.testing.assert_allclose(found.parameters["t"][:3], [0.3, -0.008, 0.01] / spread, rtol=1e-12)


def test_what_is_held_is_listed_with_the_parameter_it_matters_to_most() -> None:
    sigmas = {"lever_arm_z": 0.01, "refraction": 0.05}
    found = with_held(parameters(), correlations(), effects(), sigmas, LIMIT)
    arm, refraction = found.held
    assert (arm.quantity, arm.entity, arm.unit, arm.sigma) == ("lever_arm_z", "UCE", "m", 0.01)
    assert (arm.moves, arm.moves_entity) == ("gnss_shift_z", "1")
    assert arm.part == pytest.approx(0.0095 / found.parameters["sigma"].iloc[0])
    assert refraction.moves == "gnss_shift_z"


def test_significance_is_tested_with_the_sigma_that_is_certified() -> None:
    """−8 µm are 13 formal σ of 0.6 µm, and 1.7 σ once what refraction is known by is part of it."""
    found = with_held(parameters(), correlations(), effects(), {"refraction": 1.2}, LIMIT).parameters
    assert found["t"][:3].abs().round(1).tolist() == [2.5, 1.7, 0.5]
    assert found["status"].tolist() == ["significant", "not_significant", "not_significant", "fixed"]


@pytest.mark.parametrize(
    ("table", "sigmas"),
    [(effects("strip"), {"lever_arm_z": 0.01}), (effects(), {"lever_arm_z": 0.0}), (effects(), {})],
    ids=["other parts of the flight", "perfectly known", "not held"],
)
def test_without_anything_held_nothing_changes(table: pd.DataFrame, sigmas: dict[str, float]) -> None:
    found = with_held(parameters(), correlations(), table, sigmas, LIMIT)
    np.testing.assert_allclose(found.parameters["sigma"][:3], FORMAL, rtol=1e-12)
    np.testing.assert_allclose(found.correlations["correlation"], correlations()["correlation"], rtol=1e-12)


def test_the_datum_of_the_control_is_as_well_known_as_its_points_unless_it_is_stated() -> None:
    residuals = pd.DataFrame(
        {"group": ["control_points"] * 6, "component": list("xyz") * 2, "sigma": [0.02, 0.02, 0.04] * 2}
    )
    found = held_sigmas(HeldSigmas(), residuals)
    assert [found[f"control_shift_{axis}"] for axis in "xyz"] == [0.02, 0.02, 0.04]
    assert (found["lever_arm_x"], found["time_offset"], found["refraction"]) == (0.01, 0.0002, 0.05)
    stated = held_sigmas(HeldSigmas(control_m=(0.0, 0.0, 0.01), lever_arm_m=0.003), residuals)
    assert (stated["control_shift_x"], stated["control_shift_z"], stated["lever_arm_z"]) == (0.0, 0.01, 0.003)
    assert "control_shift_x" not in held_sigmas(HeldSigmas(), residuals[:0])
