"""The second step of a calibration, from delivered files and the cameras of the first step.

The block is adjusted on its control by dense algebra; formulas: docs/theory/two-step.md.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from flows.stories.system_calibration import system_calibration
from tests.flows.calibration_alone import calibration_alone
from tests.golden.adjusted_on_control import OnControl
from tests.golden.delivered_block import DEGREE, Array, Results
from tests.golden.oracle import computed, same, simulated
from tests.golden.strips_of_two_steps import (
    BODY,
    COMPONENTS,
    Strips,
    angles_of_rotation,
    huber,
    nested,
    sigma_of_mean,
)

LINES = "lines=4,exposures=5,end_lap=0.6,side_lap=0.6,height_m="
FLIGHT = (
    f'flight=[{{name="E",heading_deg=90.0,{LINES}2340.0}},{{name="N",heading_deg=0.0,{LINES}2000.0}}]',
    "points.count=70",
    "control.columns=5",
    "control.rows=4",
    "control.control=12",
    'project.free=["boresight", "gnss_shift", "gnss_strip_bias", "principal_point"]',
    "truth.strip_bias_m=[0.03,0.03,0.05]",
    "truth.principal_point_change_mm=[0.004,-0.003]",
)
XYZ, OPK = ("x", "y", "z"), ("omega", "phi", "kappa")
COLUMNS = [(name, "deg" if k < 3 else "m") for k, name in enumerate(COMPONENTS)]
ELSEWHERE = """
[calibration.adjusted]
file = "adjusted.csv"
format = "csv"
crs = "local"
heights = "ellipsoidal"
position = "projection_centre"
[calibration.adjusted.angles]
order = "omega-phi-kappa"
unit = "deg"
reference = "grid"
"""
FOUND = {f"boresight_{axis}": axis for axis in BODY} | {
    f"gnss_shift_{axis}": way for axis, way in zip("xyz", COMPONENTS[6:], strict=True)
}
UNITS = np.array([DEGREE] * 3 + [1.0] * 6)


@dataclass(frozen=True, eq=False)
class Published:
    """Tables and figures of a second step, and the strips they are computed from."""

    results: Results
    strips: Strips

    @cached_property
    def means(self) -> pd.DataFrame:
        table = self.results.table("orientation_difference_means")
        return table.set_index(["scope", "group", "component"])

    @cached_property
    def figure(self) -> Mapping[str, Any]:
        (found,) = self.results.summary["two_step"]
        return dict(found)


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Results]:
    """A project and the results of its calibration."""
    project = simulated(tmp_path_factory.mktemp("calibrated"), "uce-high", FLIGHT)
    return project, computed(project, ("calibration.variance_components=false",), calibration_alone)


@pytest.fixture(scope="module")
def on_control(flight: tuple[Path, Results]) -> OnControl:
    return OnControl(*flight)


@pytest.fixture(scope="module", params=["adjusted here", "adjusted elsewhere"])
def published(
    request: pytest.FixtureRequest, flight: tuple[Path, Results], on_control: OnControl
) -> Published:
    project, results = flight
    strips = on_control.strips
    if request.param == "adjusted here":
        return Published(results, strips)
    delivered = pd.DataFrame(np.hstack([strips.centre, np.degrees(strips.angles)]), columns=[*XYZ, *OPK])
    rows = delivered.assign(image=strips.given.index)
    rows[["camera", "strip"]] = strips.given[["camera", "strip"]].to_numpy()
    rows.to_csv(project.with_name("adjusted.csv"), index=False)
    text = re.sub(r"\[inputs.image_points\].*?\n\n", "", project.read_text(), flags=re.DOTALL)
    text = re.sub(r"\[inputs.control\].*?\n\n", "", text, flags=re.DOTALL) + ELSEWHERE
    alone = project.with_name("two_steps.toml")
    alone.write_text(text)
    found = computed(alone, story=system_calibration, into="two_steps")
    return Published(found, replace(strips, covariance=None))


def test_differences_of_orientations(published: Published) -> None:
    strips, table = published.strips, published.results.table("orientation_differences").set_index("image")
    table = table.loc[strips.given.index]
    same(
        table[[f"{c}_{u}" for c, u in COLUMNS]], strips.values / UNITS, "differences", of=1.0, tolerance=1e-9
    )
    weights = np.stack([huber(column).weight for column in strips.values.T], axis=1)
    same(table[[f"weight_{c}" for c in COMPONENTS]], weights, "weights", of=1.0, tolerance=1e-5)
    same(table["heading_deg"], strips.given["heading"] % 360.0, "heading", tolerance=1e-9)
    same(table["place"], strips.given["time"], "place", tolerance=1e-12)
    same(table["height_m"], strips.given["z"], "height", tolerance=1e-12)
    assert (table["strip"] == strips.given["strip"]).all()
    assert (table["mounting"] == 0).all()


def groups_of(strips: Strips) -> Mapping[tuple[str, str], Array]:
    """Exposures (n,) of the groups that are averaged, by scope and name."""
    heading, height = np.degrees(strips.heading)[strips.of_strip] % 360.0, strips.given["z"].to_numpy()
    every = np.ones(len(height), dtype=bool)
    groups = {("all", "all"): every, ("mounting", "0"): every, ("flight", "1"): every}
    for direction in (0.0, 90.0, 180.0, 270.0):
        own = np.cos(np.radians(heading - direction)) > 0.5
        groups["heading", f"{np.degrees(direction_of(strips, own)) % 360.0:.0f} deg"] = own
    for line in "EN":
        own = strips.given["strip"].str.startswith(line).to_numpy()
        groups["height", f"{np.median(height[own]):.0f} m"] = own
    return groups


def direction_of(strips: Strips, own: Array) -> float:
    """Mean heading of some exposures, rad."""
    return float(np.angle(np.exp(1j * np.radians(strips.given["heading"].to_numpy()[own])).sum()))


def in_units(mean: Array) -> Array:
    return np.concatenate([np.degrees(angles_of_rotation(mean[:3])), mean[3:]])


def test_means_of_groups(published: Published) -> None:
    strips, means, groups = published.strips, published.means, groups_of(published.strips)
    assert set(groups) == {(scope, name) for scope, name, _ in means.index if scope != "strip"}
    for group, own in groups.items():
        table, values, of_strip = (
            means.loc[group].loc[list(COMPONENTS)],
            strips.values[own],
            strips.of_strip[own],
        )
        chosen, count = np.unique(of_strip, return_counts=True)
        found = [huber(column) for column in values.T]
        mean = np.array([one.value for one in found])
        same(table["value"], in_units(mean), "mean", of=1.0, tolerance=1e-9)
        plain = values.mean(axis=0)
        same(table["value_plain"], in_units(plain), "plain mean", of=1.0, tolerance=1e-9)
        sums = np.array([(values - plain)[of_strip == k].sum(axis=0) for k in chosen]) / len(values)
        sigma = np.sqrt(len(sums) / (len(sums) - 1) * (sums**2).sum(axis=0)) / UNITS
        same(table["sigma_plain"], sigma, "σ of the plain mean")
        same(table["rms"], np.sqrt(((values - mean) ** 2).mean(axis=0)) / UNITS, "RMS")
        same(table["between_strips"], strips.mean[chosen].std(axis=0, ddof=1) / UNITS, "between strips")
        if strips.known is None:
            same(table["sigma"], [one.sigma(of_strip) for one in found] / UNITS, "σ", tolerance=1e-7)
            assert (table["freedom"] == len(chosen) - 1).all()
            assert table["sigma_adjusted"].isna().all()
        else:
            at = np.ix_(chosen, chosen)
            own_known = [strips.known[k, :, k][at] for k in range(9)]
            expected = np.array(
                [sigma_of_mean(strips.mean[chosen, k], own_known[k], count) for k in range(9)]
            )
            # The mixture is summed over 300 values of χ².
            same(table["sigma"], expected[:, 0] / UNITS, "σ", tolerance=3e-4)
            same(table["freedom"], expected[:, 1], "degrees of freedom", tolerance=1e-3)
            # A rotation of the camera is taken for the change of a rotation vector of 0.03°.
            same(table["sigma_adjusted"], expected[:, 2] / UNITS, "σ by the adjustment", tolerance=1e-4)
        assert (table["images"] == own.sum()).all()
        assert (table["strips"] == len(chosen)).all()
        heading = np.degrees(direction_of(strips, own)) % 360.0
        if group[0] == "heading":
            same(table["heading_deg"], np.full(9, heading), "heading", tolerance=1e-9)
        same(table["height_m"], np.full(9, strips.given["z"][own].median()), "height")


def test_means_of_strips(published: Published) -> None:
    strips, time = published.strips, published.strips.given["time"].to_numpy()
    for k, name in enumerate(strips.names):
        table, own = published.means.loc[("strip", name)].loc[list(COMPONENTS)], strips.of_strip == k
        values, t = strips.values[own], time[own] - time[own].mean()
        same(table["value"], in_units(strips.mean[k]), "mean", of=1.0, tolerance=1e-9)
        sigma = np.array([one.sigma(np.zeros(own.sum())) for one in strips.robust[k]])
        same(table["sigma"], sigma / UNITS, "σ")
        same(table["rms"], values.std(axis=0, ddof=1) / UNITS, "scatter")
        design = np.column_stack([np.ones_like(t), t])
        line, squares, *_ = np.linalg.lstsq(design, values, rcond=None)
        same(table["drift"], line[1] * np.ptp(t) / UNITS, "drift", of=np.sqrt(squares) / UNITS)
        sigma = np.sqrt(squares / (len(t) - 2) / (t @ t)) * np.ptp(t)
        same(table["sigma_drift"], sigma / UNITS, "σ of a drift")
        same(table["heading_deg"], np.full(9, np.degrees(strips.heading[k]) % 360.0), "heading")
        assert (table["images"] == own.sum()).all()
        assert not table["outlying"].any()


def offsets_of(strips: Strips) -> dict[str, tuple[Array, Array, Array, Array | None]]:
    """Nested models of the strips: smaller and larger design, values, their known errors."""
    s = len(strips.names)
    known = None if strips.known is None else strips.known[6:8][..., 6:8, :]
    in_plan = None if known is None else known.transpose(1, 0, 3, 2).reshape(2 * s, 2 * s)
    shift, lever_arm = np.kron(np.ones((s, 1)), np.eye(2)), strips.body_fixed(np.arange(s))
    offset, both = strips.mean[:, 6:8].ravel(), np.hstack([shift, lever_arm])
    return {
        "offset": (both[:, :0], both, offset, in_plan),
        "lever_arm": (shift, both, offset, in_plan),
        "shift": (lever_arm, both, offset, in_plan),
    }


def test_lever_arm_and_shift(published: Published) -> None:
    figure, models = published.figure, offsets_of(published.strips)
    for test in figure["tests"]:
        if test["tested"] not in models:  # one flight, one mounting
            assert (test["chi_squared"], test["freedom"]) == (None, 0)
            continue
        chi2, q, f, probability = nested(*models[test["tested"]])
        assert (test["freedom"], test["variance_freedom"]) == (q, f)
        same([test["chi_squared"], test["probability"]], [chi2, probability], "nested test", tolerance=1e-6)
    says = {
        test["tested"]: test["probability"] is not None and test["probability"] < 0.025
        for test in figure["tests"]
    }
    verdicts = {(True, True): "both", (True, False): "body", (False, True): "map"}
    neither = "undecided" if says["offset"] else "neither"
    assert figure["offset_fixed_in"] == verdicts.get((says["lever_arm"], says["shift"]), neither)
    _, design, y, known = models["offset"]
    cofactor = np.linalg.inv(design.T @ design)
    gain = cofactor @ design.T
    rest, f = np.eye(len(y)) - design @ gain, len(y) - 4
    variance, of_known = y @ rest @ y / f, np.zeros((4, 4))
    if known is not None:
        variance, of_known = max(variance - np.trace(rest @ known) / f, 0.0), gain @ known @ gain.T
    sigma = np.sqrt(np.diagonal(variance * cofactor + of_known))
    found = figure["separated"]
    assert found["freedom"] == f
    values = [*found["shift_m"], *found["lever_arm_m"]]
    same(values, gain @ y, "lever arm and shift together", of=sigma, tolerance=1e-7)
    same([*found["shift_sigma_m"], *found["lever_arm_sigma_m"]], sigma, "σ of both", tolerance=1e-6)


def test_figures(published: Published) -> None:
    figure, strips, means = published.figure, published.strips, published.means
    main = means.loc[("mounting", "0")].loc[list(COMPONENTS)]
    expected = {
        f"{name}{ending}": main[column].to_numpy()[3 * k : 3 * k + 3].tolist()
        for k, (name, unit) in enumerate((("boresight", "deg"), ("lever_arm", "m"), ("shift", "m")))
        for ending, column in ((f"_{unit}", "value"), (f"_sigma_{unit}", "sigma"))
    } | {"freedom": main["freedom"].tolist()}
    (mounting,), (of_flight,) = figure["mountings"], figure["flights"]
    for part in (figure, mounting, of_flight):
        assert {name: part[name] for name in expected} == expected
        assert part["images"] == len(strips.given)
    assert mounting["strips"] == strips.names
    assert (figure["strips"], figure["directions"]) == (len(strips.names), 4)
    for name, first in (("offset_rms_body_m", 3), ("offset_rms_map_m", 6)):
        same(figure[name], np.hypot(*main["rms"].to_numpy()[first : first + 2]), name, tolerance=1e-9)
    robust, plain = np.array([huber(c).value for c in strips.values.T]), strips.values.mean(axis=0)
    from_body = np.diag([1.0, -1.0, -1.0])
    for name, mean in (("all_plain", plain), ("all_robust", robust), ("main_robust", robust)):
        axes = figure["adjusted_minus_observed_in_camera_axes"][name]
        same(axes["rotation_deg"], np.degrees(from_body @ mean[:3]), name, tolerance=1e-7)
        same(axes["offset_m"], -from_body @ mean[3:6], name, tolerance=1e-7)


def test_both_steps_compared(flight: tuple[Path, Results]) -> None:
    results = flight[1]
    figure = results.summary["calibration"]["two_step"]
    record = json.loads((results.folder / "calibration.json").read_text())
    means = results.table("orientation_difference_means").set_index(["scope", "component"]).loc["mounting"]
    names = [(item["parameter"], item["entity"]) for item in figure["parameters"]]
    assert len(names) == 6
    known = [item for item in record["parameters"] if item.get("sigma") is not None]
    order = [(item["parameter"], item["entity"]) for item in known]
    chosen = [order.index(name) for name in names]
    covariance = np.array(record["covariance"])[np.ix_(chosen, chosen)]
    rows = means.loc[[FOUND[parameter] for parameter, _ in names]]
    widened = (rows["sigma"] * stats.t.ppf(0.9995, rows["freedom"]) / stats.norm.ppf(0.9995)).to_numpy()
    value = results.table("parameters").set_index(["parameter", "entity"])["value"].loc[names].to_numpy()
    difference, sigma = value - rows["value"].to_numpy(), np.sqrt(np.diagonal(covariance))
    for column, values in (
        ("one_step", value),
        ("one_step_sigma", sigma),
        ("two_step", rows["value"]),
        ("two_step_sigma", rows["sigma"]),
        ("difference", difference),
        ("t", difference / np.hypot(sigma, widened)),
    ):
        same([item[column] for item in figure["parameters"]], values, column, tolerance=1e-9)
    chi2 = difference @ np.linalg.solve(covariance + np.diag(widened**2), difference)
    same([figure["chi_squared"], figure["probability"]], [chi2, stats.chi2.sf(chi2, 6)], "χ²")


@pytest.mark.parametrize("published", ["adjusted elsewhere"], indirect=True)
def test_verdict_on_delivered_orientations(published: Published) -> None:
    found, figure = published.results.summary["two_step_calibration"], published.figure
    limits = {"roll": 0.0005, "pitch": 0.0005, "yaw": 0.001}
    assert figure["offset_fixed_in"] == "map"
    for item in found["parameters"]:
        name = item["parameter"]
        if name.startswith("lever_arm"):
            assert (item["verdict"], item["sigma"]) == ("not_called_for", None)
            continue
        row, limit = published.means.loc["mounting", "0", FOUND[name]], limits.get(FOUND[name], 0.03)
        assert (item["value"], item["sigma"], item["limit"]) == (row["value"], row["sigma"], limit)
        widened = row["sigma"] * stats.t.ppf(0.975, row["freedom"]) / stats.norm.ppf(0.975)
        beyond = int(widened > limit) + int(widened > 3.0 * limit)
        expected = ("determined", "weak", "not_determinable")[beyond]
        assert item["verdict"] == expected
    assert found["verdict"] == "refused"
