"""Verdicts: σ decides, a prior that has taken over is no result, and every refusal says what to fly."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pandas as pd
import pytest

from adjust.calibration.flight_pattern import FlightPattern, flight_pattern
from tasks.calibration.verdicts import FlightVerdict, ParameterVerdict, flight_verdict, parameter_verdicts
from tasks.quantities import written_sigma
from tasks.settings.calibration import AcceptanceLimits

NAN = float("nan")
# A good flight: half of every limit.
GOOD = {
    "focal_length": 1.0e-3,
    "principal_point_x": 0.5e-3,
    "principal_point_y": 0.5e-3,
    "boresight_roll": 0.25e-3,
    "boresight_pitch": 0.25e-3,
    "boresight_yaw": 0.5e-3,
    "gnss_shift_x": 0.015,
    "gnss_shift_y": 0.015,
    "gnss_shift_z": 0.015,
}


def pattern(
    headings: tuple[float, ...] = (90.0, 270.0), heights: tuple[float, ...] = (780.0, 2340.0)
) -> FlightPattern:
    strips = [(heading, height) for heading in headings for height in heights]
    heading, height = np.repeat(np.array(strips), 5, axis=0).T
    return flight_pattern(np.deg2rad(heading), height, np.repeat(np.arange(len(strips)), 5))


def table(sigmas: dict[str, float], **changed: object) -> pd.DataFrame:
    """A table of parameters; `changed` maps a parameter to its status or to its σ_prior."""
    rows = []
    for name, sigma in sigmas.items():
        entity = "1" if name.startswith("gnss_shift") else "L1" if name.startswith("gnss") else "UCE"
        unit = "m" if name.startswith(("gnss", "lever")) else "deg" if name.startswith("bore") else "mm"
        change = changed.get(name)
        rows.append(
            {
                "parameter": name,
                "entity": entity,
                "value": 0.0,
                "change": 0.0,
                "sigma": sigma,
                "sigma_over_prior": sigma / change if isinstance(change, float) else NAN,
                "sigma_prior": change if isinstance(change, float) else NAN,
                "unit": unit,
                "t": NAN,
                "status": change if isinstance(change, str) else "significant",
            }
        )
    return pd.DataFrame(rows)


def correlated(parameters: pd.DataFrame, **pairs: float) -> pd.DataFrame:
    """Correlations of all pairs of free parameters: those given as a__b = ρ, else 0.1."""
    keys = [
        (row["parameter"], row["entity"]) for _, row in parameters.iterrows() if np.isfinite(row["sigma"])
    ]
    rows = [
        (*a, *b, pairs.get(f"{a[0]}__{b[0]}", pairs.get(f"{b[0]}__{a[0]}", 0.1)))
        for a, b in combinations(keys, 2)
    ]
    return pd.DataFrame(rows, columns=["parameter_a", "entity_a", "parameter_b", "entity_b", "correlation"])


def judged(
    parameters: pd.DataFrame,
    flown: FlightPattern | None = None,
    limits: AcceptanceLimits | None = None,
    heads: tuple[str, ...] = (),
    **pairs: float,
) -> tuple[dict[str, ParameterVerdict], FlightVerdict]:
    flown, limits = flown or pattern(), limits or AcceptanceLimits()
    correlations = correlated(parameters, **pairs)
    verdicts = parameter_verdicts(parameters, correlations, flown, limits)
    found = {key[0]: verdict for key, verdict in verdicts.items()}
    return found, flight_verdict(parameters, correlations, verdicts, flown, limits, heads=heads)


def test_a_flight_within_all_limits_is_accepted_whatever_the_correlation() -> None:
    verdicts, flight = judged(table(GOOD), focal_length__gnss_shift_z=-0.97)
    assert {item.verdict for item in verdicts.values()} == {"determined"}
    assert flight.verdict == "accepted"
    assert flight.reasons == ()
    assert any("97 % correlated" in remark for remark in flight.remarks)


def test_determined_parameters_that_are_correlated_in_a_chain_are_one_remark() -> None:
    pairs = {"focal_length__gnss_shift_z": -0.97, "gnss_shift_y__gnss_shift_z": 0.96}
    _, flight = judged(table(GOOD), **pairs)
    found = [remark for remark in flight.remarks if "correlated" in remark]
    assert found == [
        "focal_length of UCE, gnss_shift_y of 1 and gnss_shift_z of 1 are up to 97 % correlated, although "
        "all are determined: use their values together only."
    ]


@pytest.mark.parametrize("parameter", sorted(GOOD))
def test_every_limit_is_tested_and_the_number_said(parameter: str) -> None:
    good = GOOD[parameter]
    for factor, verdict in ((1.99, "determined"), (2.01, "weak"), (5.99, "weak"), (6.01, "not_determinable")):
        verdicts, flight = judged(table(GOOD | {parameter: factor * good}))
        assert verdicts[parameter].verdict == verdict
        assert (flight.verdict == "accepted") == (verdict == "determined")
        others = [item for name, item in verdicts.items() if name != parameter]
        assert {item.verdict for item in others} == {"determined"}
        if verdict != "determined":
            (reason,) = flight.reasons
            assert parameter in reason
            assert verdict.replace("_", " ") in reason
            assert "limit" in reason


def test_one_height_cannot_tell_focal_length_from_the_shift_and_the_second_height_is_asked_for() -> None:
    bad = GOOD | {"focal_length": 9.8e-3, "gnss_shift_z": 0.096}
    verdicts, flight = judged(table(bad), pattern(heights=(780.0,)), focal_length__gnss_shift_z=-0.9996)
    said = verdicts["focal_length"]
    assert said.verdict == "not_determinable"
    assert "σ 9.8 µm, limit 2 µm" in said.because
    assert "correlated −99.96 % with gnss_shift_z of 1" in said.because
    assert "a second flying height" in said.because
    assert "one height (780 m above ground)" in flight.reasons[0]
    assert "1560 m" in flight.reasons[0]


def test_one_direction_cannot_tell_the_principal_point_from_the_shift() -> None:
    bad = GOOD | {"principal_point_x": 4.9e-3, "gnss_shift_x": 0.048}
    verdicts, flight = judged(table(bad), pattern(headings=(90.0,)), principal_point_x__gnss_shift_x=-0.99)
    assert "strips flown in opposite or crossing directions" in verdicts["principal_point_x"].because
    assert "Flown in one direction only (heading 90°), but 2 are needed for" in flight.reasons[0]


def test_directions_are_asked_for_even_if_the_standard_deviations_are_reached() -> None:
    _, flight = judged(table(GOOD), pattern(headings=(90.0,)))
    assert flight.verdict == "refused"
    assert len(flight.reasons) == 1


def test_heads_that_converge_determine_focal_lengths_at_one_height() -> None:
    verdicts, flight = judged(table(GOOD), pattern(heights=(780.0,)), heads=("UCE", "left"))
    assert flight.verdict == "accepted"
    assert verdicts["focal_length"].verdict == "determined"
    assert "one height (780 m above ground), with the GNSS shift in height unknown" in flight.remarks[0]
    assert "σ up to 1 µm" in flight.remarks[0]


@pytest.mark.parametrize(
    ("parameters", "heads"),
    [
        # The height of the flight is taken from GNSS.
        (table({name: sigma for name, sigma in GOOD.items() if name != "gnss_shift_z"}), ("UCE",)),
        (table(GOOD, gnss_shift_z=0.016), ("UCE",)),
        # σ says that the heads do not determine it.
        (table(GOOD | {"focal_length": 2.1e-3}), ("UCE",)),
        # One camera alone.
        (table(GOOD), ()),
        (table(GOOD), ("another",)),
    ],
)
def test_a_second_height_is_asked_for_where_heads_do_not_replace_it(
    parameters: pd.DataFrame, heads: tuple[str, ...]
) -> None:
    _, flight = judged(parameters, pattern(heights=(780.0,)), heads=heads)
    assert flight.verdict == "refused"
    assert any("focal length from GNSS positions requires flying heights" in one for one in flight.reasons)


def test_what_was_flown_already_is_not_asked_for() -> None:
    bad = GOOD | {"focal_length": 2.5e-3}
    verdicts, _ = judged(table(bad), focal_length__gnss_shift_z=-0.9)
    assert "more strips" in verdicts["focal_length"].because
    assert "second flying height" not in verdicts["focal_length"].because


def test_boresight_alone_needs_neither_directions_nor_heights() -> None:
    only = {name: sigma for name, sigma in GOOD.items() if name.startswith("boresight")}
    _, flight = judged(table(only), pattern(headings=(90.0,), heights=(780.0,)))
    assert flight.verdict == "accepted"


def test_a_prior_that_has_taken_over_is_not_determined_however_small_correlation_and_sigma_are() -> None:
    """σ within its limit, hardly correlated, and nothing learnt: σ/σ_prior says so."""
    parameters = table(GOOD, gnss_shift_z=0.016, gnss_shift_x=0.03, gnss_shift_y=0.06)
    verdicts, flight = judged(parameters)
    assert verdicts["gnss_shift_z"].verdict == "not_determinable"
    assert "σ/σ_prior 0.94" in verdicts["gnss_shift_z"].because
    assert verdicts["gnss_shift_x"].verdict == "weak"
    assert verdicts["gnss_shift_y"].verdict == "determined"
    assert flight.verdict == "refused"
    assert "control points" in verdicts["gnss_shift_z"].because


@pytest.mark.parametrize("status", ["not_determinable", "prior_only"])
def test_what_the_adjustment_calls_undetermined_stays_so(status: str) -> None:
    verdicts, flight = judged(table(GOOD, focal_length=status))
    assert verdicts["focal_length"].verdict == "not_determinable"
    assert flight.verdict == "refused"


def test_held_parameters_are_held_and_no_reason_to_refuse() -> None:
    sigmas = GOOD | {"lever_arm_x": NAN, "lever_arm_y": NAN}
    verdicts, flight = judged(table(sigmas, lever_arm_x="fixed", lever_arm_y="eliminated"))
    assert verdicts["lever_arm_x"].verdict == verdicts["lever_arm_y"].verdict == "held"
    assert verdicts["lever_arm_x"].because == ""
    assert "eliminated" in verdicts["lever_arm_y"].because
    assert flight.verdict == "accepted"


def test_free_shifts_of_strips_beside_the_interior_orientation_are_refused_with_the_number() -> None:
    sigmas = GOOD | {"focal_length": 5.5e-3} | {f"gnss_strip_bias_{axis}": 0.05 for axis in "xyz"}
    _, flight = judged(table(sigmas))
    assert "free (without a prior)" in flight.reasons[0]
    assert "focal_length 5.5 µm" in flight.reasons[0]
    _, flight = judged(table(sigmas, **{f"gnss_strip_bias_{axis}": 10.0 for axis in "xyz"}))
    assert "with a prior of 10 m" in flight.reasons[0]
    good = sigmas | {"focal_length": 1e-3}
    _, flight = judged(table(good))
    assert flight.verdict == "accepted"
    assert "focal_length 1 µm" in flight.remarks[0]


def test_random_biases_of_strips_are_no_quantities_of_the_calibration() -> None:
    sigmas = GOOD | {f"gnss_strip_bias_{axis}": 0.028 for axis in "xyz"}
    parameters = table(sigmas, **{f"gnss_strip_bias_{axis}": 0.03 for axis in "xyz"})
    verdicts, flight = judged(parameters, gnss_strip_bias_x__gnss_shift_x=0.9)
    assert flight.verdict == "accepted"
    assert verdicts["gnss_shift_x"].strongest is not None
    assert "strip" not in verdicts["gnss_shift_x"].strongest.parameter
    assert not any("common to a strip" in remark for remark in flight.remarks)
    _, white = judged(table(GOOD))
    assert any("common to a strip" in remark for remark in white.remarks)


def test_nothing_estimated_is_no_calibration() -> None:
    _, flight = judged(table({"focal_length": NAN}, focal_length="fixed"))
    assert flight.verdict == "refused"
    assert "Nothing" in flight.reasons[0] or "No calibration parameter" in flight.reasons[0]


def test_limits_are_those_of_the_project() -> None:
    strict = AcceptanceLimits(focal_length_um=0.9, height_ratio=4.0)
    verdicts, flight = judged(table(GOOD), limits=strict)
    assert verdicts["focal_length"].verdict == "weak"
    assert any("ratio of at least 4" in reason for reason in flight.reasons)


@pytest.mark.parametrize(
    ("value", "unit", "written"),
    [
        (0.00204, "mm", "2.04 µm"),
        (6.4e-5, "deg", "0.000064°"),
        (0.0011, "deg", "0.0011°"),
        (0.001, "deg", "0.001°"),
        (0.0163, "m", "1.63 cm"),
        (0.0009, "s", "0.9 ms"),
        (1.5e-9, "1/mm²", "1.5e-09 1/mm²"),
    ],
)
def test_standard_deviations_are_written_as_people_say_them(value: float, unit: str, written: str) -> None:
    assert written_sigma(value, unit) == written
