"""Statistics of an adjustment by dense algebra, from the delivered files and the adjusted values.

The equations are those of `delivered_block`; the package is used only to simulate and to adjust. Formulas:
docs/theory/adjustment.md.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from tests.golden.delivered_block import (
    ANGLES,
    BROWN,
    DEGREE,
    PLACE,
    UNITS,
    Array,
    about,
    angles_of,
    block_diagonal,
    brown,
    family_of,
    inverse,
    named,
    opk,
    part_of,
    turned,
)
from tests.golden.delivered_refraction import coefficient
from tests.golden.likelihood import Likelihood
from tests.golden.oracle import CORRELATED, DELTA0, Case, Oracle, nothing, same, with_own_sigmas_and_distances

ELEMENTS = (*PLACE, *ANGLES)
OF_ELEMENTS = np.array([1.0, 1.0, 1.0, DEGREE, DEGREE, DEGREE])


CASES = {
    "a map, refraction, distances, a σ of its own for every coordinate": Case(
        (
            "project.crs=EPSG:25832",
            "project.latitude_deg=48.9",
            "project.longitude_deg=10.7",
            "project.angles=omega-phi-kappa",
            "truth.refraction=true",
            "truth.strip_bias_m=[0.03,0.03,0.05]",
        ),
        with_own_sigmas_and_distances,
        (),
    ),
    "correlation in time, rejection, σ0 a priori": Case(
        (
            "noise.gnss_m=[0,0,0]",
            "noise.gnss_markov_m=[0.05,0.05,0.06]",
            "noise.ins_deg=[0,0,0]",
            "noise.ins_markov_deg=[0.003,0.003,0.008]",
            "noise.gross_errors.image_rate=0.02",
            "truth.lever_arm_m=[0.2,-0.1,0.3]",
            "truth.time_offset_s=0.002",
            "truth.strip_drift_m_s=[0.002,0.002,0.002]",
        ),
        nothing,
        ("adjustment.sigma0=a_priori",),
    ),
    "variance components and correlation times": Case(
        CORRELATED, nothing, ("adjustment.estimate_correlation=true", "adjustment.variance_components=true")
    ),
    "refraction, variance components, self-calibration": Case(
        (
            "truth.refraction=true",
            "truth.strip_bias_m=[0.03,0.03,0.05]",
            "truth.focal_length_change_mm=0.01",
            "truth.image_errors.radial_um=5",
            "noise.gnss_m=[0.02,0.02,0.10]",
        ),
        nothing,
        (
            "adjustment.variance_components=true",
            'adjustment.self_calibration={parameters="brown:K1,P1,B1", elimination="none"}',
        ),
    ),
}


@pytest.fixture(scope="module", params=CASES)
def oracle(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Oracle:
    return Oracle.of_case(CASES[request.param], tmp_path_factory.mktemp("delivered"))


def test_the_adjusted_values_are_at_the_minimum(oracle: Oracle) -> None:
    d, summary = oracle.dense, oracle.results.summary
    b = -d.a.T @ d.p @ d.v
    # A bound of the distance of every unknown from the minimum, in its σ.
    assert np.sqrt(b @ d.q @ b) < 1e-4
    assert summary["redundancy"] == d.redundancy
    same(summary["sigma0"], d.sigma0, "σ0")
    quantiles = stats.chi2.ppf([0.025, 0.975], d.redundancy)
    test = summary["global_test"]
    same([test["lower"], test["upper"]], np.sqrt(quantiles / d.redundancy), "limits of σ0")
    assert test["passed"] == bool(test["lower"] <= d.sigma0 <= test["upper"])


def test_residuals_and_their_statistics(oracle: Oracle) -> None:
    d, table = oracle.dense, oracle.residuals
    unit = table["unit"].map(lambda name: UNITS.get(name, 1.0)).to_numpy()
    sigma = np.sqrt(np.diagonal(d.covariance))
    of_error = np.sqrt(np.diagonal(oracle.scatter))
    same(table["sigma"] * unit, sigma, "σ")
    same(table["residual"] * unit / sigma, d.v / sigma, "v", of=np.ones(len(sigma)), tolerance=2e-5)
    same(table["redundancy"], oracle.redundancy, "r", of=np.ones(len(sigma)))
    # What nothing controls has no digits left.
    told = oracle.redundancy > 1e-4
    w = d.p @ d.v / of_error
    same(table["standardized"][told], w[told], "w", of=np.ones(told.sum()), tolerance=1e-4)
    same((table["mdb"] * unit)[told], (DELTA0 / of_error)[told], "∇₀")
    external = DELTA0 / of_error * np.sqrt(np.maximum(np.diagonal(oracle.fitted), 0.0))
    same(table["external"][told], external[told], "δ̄")
    controlled = (of_error * sigma) ** 2 >= 0.1
    np.testing.assert_array_equal(table["status"], np.where(controlled, "used", "uncontrolled"))


def test_groups(oracle: Oracle) -> None:
    d, every = oracle.dense, oracle.results.table("residuals")
    family = np.array([family_of(key[0]) for key in oracle.keys])
    squares = d.v * (d.p @ d.v)
    for group in oracle.results.summary["groups"]:
        own = family == group["group"]
        r = oracle.redundancy[own].sum()
        assert group["observations"] == own.sum()
        same(group["redundancy"], r, "r of a group")
        same(group["sigma0"], np.sqrt(squares[own].sum() / r), "σ0 of a group", tolerance=1e-5)
        of_table = every[every["group"].str.startswith(group["group"])]
        assert group["uncontrolled"] == (of_table["status"] == "uncontrolled").sum()
        rejected = of_table[of_table["status"] == "rejected"]
        assert group["rejected_rows"] == len(rejected.groupby(["image", "point"], dropna=False))


def test_orientations_and_neighbours(oracle: Oracle) -> None:
    table, q = oracle.results.table("exterior_orientations"), oracle.dense.q
    n = len(table)
    sigma = oracle.factor * oracle.spread[: 6 * n].reshape(n, 6) / OF_ELEMENTS
    same(table[[f"sigma_{name}" for name in ELEMENTS]], sigma, "σ of orientations")
    every = 6 * np.arange(n)
    for i, j in combinations(range(6), 2):
        a, b = ELEMENTS[i].split("_")[0], ELEMENTS[j].split("_")[0]
        expected = q[every + i, every + j] / (oracle.spread[every + i] * oracle.spread[every + j])
        same(table[f"correlation_{a}_{b}"], expected, "correlation", of=np.ones(n))
    pairs = oracle.results.table("neighbouring_images")
    for k, name in enumerate(ELEMENTS):
        i, j = (pairs[c].map(oracle.block.image_number).to_numpy() * 6 + k for c in ("image", "next_image"))
        axis, unit = name.split("_")
        expected = q[i, j] / (oracle.spread[i] * oracle.spread[j])
        same(pairs[f"rho_{axis}"], expected, "ρ", of=np.ones(len(i)))
        difference = oracle.factor * np.sqrt(q[i, i] + q[j, j] - 2.0 * q[i, j]) / OF_ELEMENTS[k]
        same(pairs[f"sigma_d{axis}_{unit}"], difference, "σ of a difference")


def test_points_and_parameters(oracle: Oracle) -> None:
    points, table = oracle.results.table("object_points"), oracle.results.table("parameters")
    q = oracle.dense.q
    sigma = oracle.factor * oracle.spread[oracle.first_point : oracle.border].reshape(-1, 3)
    same(points[["sigma_x_m", "sigma_y_m", "sigma_z_m"]], sigma, "σ of points")
    rays = pd.Series([key[2] for key in oracle.keys if key[0] == "image_points" and key[3] == "x"])
    assert (rays.value_counts().loc[points["point"]].to_numpy() == points["rays"].to_numpy()).all()
    free = table[oracle.block.free]
    names = list(zip(free["parameter"], free["entity"], strict=True))
    unit = np.array([oracle.unit_of(name) for name in names])
    cofactor = oracle.spread[oracle.border :] / unit
    same(free["sigma"], oracle.factor * cofactor, "σ of parameters")
    t = free["change"].to_numpy() / (oracle.factor * cofactor)
    same(free["t"], t, "t", of=np.maximum(1.0, np.abs(t)))
    known = free["sigma_prior"].notna().to_numpy()
    if known.any():
        same(free["sigma_over_prior"][known], (cofactor / free["sigma_prior"])[known], "σ over prior")
    limit = stats.t.ppf(0.975, oracle.dense.redundancy)
    tested = free["status"].isin(["significant", "not_significant"])
    assert ((np.abs(t) > limit) == (free["status"] == "significant"))[tested].all()
    pairs = oracle.results.table("correlations")
    assert len(pairs) == len(free) * (len(free) - 1) // 2
    i, j = (
        np.array(
            [oracle.free[name] for name in zip(pairs[f"parameter_{k}"], pairs[f"entity_{k}"], strict=True)]
        )
        for k in "ab"
    )
    expected = q[i, j] / (oracle.spread[i] * oracle.spread[j])
    same(pairs["correlation"], expected, "correlation of parameters", of=np.ones(len(i)))


def without(oracle: Oracle, rows: list[int]) -> tuple[Array, Array]:
    """Residuals of some observations, predicted by the solution without them, and their covariance, σ0 = 1.

    They are uncorrelated with all others.
    """
    d = oracle.dense
    a, v = d.a[rows], d.v[rows]
    weight = np.linalg.inv(d.covariance[np.ix_(rows, rows)])
    q = inverse(d.n - a.T @ weight @ a)
    moved = -q @ (d.a.T @ d.p @ d.v - a.T @ weight @ v)
    return v + a @ moved, a @ q @ a.T


def test_control_points(oracle: Oracle) -> None:
    d, table = oracle.dense, oracle.results.table("control_residuals").set_index("point")
    spread = d.covariance - d.a @ d.q @ d.a.T
    expected = {name: np.full((len(table), 3), np.nan) for name in ("d", "sigma_d", "loo_d", "sigma_loo_d")}
    for n, point in enumerate(table.index):
        rows = {k: oracle.row.get(("control_points", "", point, axis)) for k, axis in enumerate("xyz")}
        own = [row for row in rows.values() if row is not None]
        left_out, cofactor = without(oracle, own)
        variance = np.diagonal(d.covariance)[own] + oracle.factor**2 * np.diagonal(cofactor)
        at = [k for k, row in rows.items() if row is not None]
        expected["d"][n, at] = d.v[own]
        expected["sigma_d"][n, at] = oracle.factor * np.sqrt(np.diagonal(spread)[own])
        expected["loo_d"][n, at], expected["sigma_loo_d"][n, at] = left_out, np.sqrt(variance)
    known = np.isfinite(expected["d"])
    for name, values in expected.items():
        found = table[[f"{name}{axis}_m" for axis in "xyz"]].to_numpy()
        np.testing.assert_array_equal(np.isfinite(found), known, err_msg=name)
        of = expected["sigma_loo_d"][known]
        same(found[known], values[known], name, of=of, tolerance=2e-5)
    summary = oracle.results.summary
    figures = summary["leave_one_out"]
    d, left_out, sigma = (expected[name] for name in ("d", "loo_d", "sigma_loo_d"))
    for found, values in (
        (summary["rmse_control_m"], np.sqrt(np.nanmean(d**2, axis=0))),
        (summary["max_control_m"], np.nanmax(np.abs(d), axis=0)),
        (figures["rmse_m"], np.sqrt(np.nanmean(left_out**2, axis=0))),
        (figures["max_m"], np.nanmax(np.abs(left_out), axis=0)),
        (figures["rms_over_sigma"], np.sqrt(np.nanmean((left_out / sigma) ** 2, axis=0))),
    ):
        same(found, values, "figures of control", tolerance=1e-4)


def test_check_points(oracle: Oracle) -> None:
    block, table = oracle.block, oracle.results.table("check_points")
    number = np.array([block.point_number[point] for point in table["point"]])
    given = block.control.loc[table["point"], ["x", "y", "z"]].to_numpy()
    enu = np.swapaxes(block.frame.enu(given), 1, 2)
    difference = turned(enu, block.place[number] - block.frame.local(given))
    difference[:, 2] = block.map_of_point[number, 2] - given[:, 2]
    of_points = np.zeros((3 * len(number), len(oracle.dense.columns)))
    for n, (point, axes) in enumerate(zip(number, enu @ block.point_axes[number], strict=True)):
        first = oracle.first_point + 3 * point
        of_points[3 * n : 3 * n + 3, first : first + 3] = axes
    turn = enu @ block.frame.grid(given)
    survey = block.survey_sigma.loc[table["point"]].to_numpy() ** 2
    covariance = oracle.factor**2 * of_points @ oracle.dense.q @ of_points.T
    covariance += block_diagonal(np.einsum("nij,nj,nkj->nik", turn, survey, turn))
    sigma = np.sqrt(np.diagonal(covariance)).reshape(-1, 3)
    same(table[["dx_m", "dy_m", "dz_m"]], difference, "differences", of=sigma, tolerance=2e-5)
    same(table[["sigma_dx_m", "sigma_dy_m", "sigma_dz_m"]], sigma, "σ of differences")
    summary = oracle.results.summary
    rmse = np.sqrt(np.mean(difference**2, axis=0))
    same(summary["rmse_check_m"], rmse, "RMS", tolerance=1e-4)
    same(summary["max_check_m"], np.abs(difference).max(axis=0), "largest", tolerance=1e-4)
    test = summary["check_point_test"]
    share, q, over = (1.0 - test["confidence"]) / 6, len(number), list[float]()
    for k in range(3):
        own = covariance[k::3, k::3]
        predicted, freedom = np.sqrt(np.trace(own) / q), np.trace(own) ** 2 / np.trace(own @ own)
        low, high = predicted * np.sqrt(stats.chi2.ppf([share / 2, 1.0 - share / 2], freedom) / freedom)
        of_mean = np.sqrt(own.sum()) / q
        limit, mean = stats.norm.ppf(1.0 - share / 2) * of_mean, difference[:, k].mean()
        over += [rmse[k] / high, abs(mean) / limit]
        for name, value in {
            "points": q,
            "rmse_m": rmse[k],
            "predicted_rmse_m": predicted,
            "predicted_low_m": low,
            "predicted_high_m": high,
            "ratio": rmse[k] / predicted,
            "predicted_mean_sigma_m": of_mean,
            "mean_limit_m": limit,
            "degrees_of_freedom": freedom,
        }.items():
            same(test[name][k], value, name, tolerance=1e-4)
        same(test["mean_m"][k], mean, "mean", of=of_mean, tolerance=1e-4)
    same(test["over_limit"], max(over), "over the limit", tolerance=1e-4)
    same(summary["check_over_limit"], max(over), "over the limit", tolerance=1e-4)


def test_influences_of_observations_on_parameters(oracle: Oracle) -> None:
    d, table = oracle.dense, oracle.results.table("parameter_influences")
    gain = d.q @ d.a.T @ d.p
    kinds = {"position": ("gnss_positions", "xyz"), "control": ("control_points", "xyz")}
    kinds["attitude"] = ("ins_attitudes", ("roll", "pitch", "yaw"))  # type: ignore[assignment]
    found, expected = list[float](), list[float]()
    for row in table.itertuples():
        name = (str(row.parameter), str(row.entity))
        for k, axis in enumerate("xyz"):
            if row.observation == "strip_bias":
                key = (f"prior:gnss_strip_bias:{row.name}", "", "", f"gnss_strip_bias_{axis}")
            else:
                group, components = kinds[str(row.observation)]
                point = row.observation == "control"
                key = (group, "" if point else row.name, row.name if point else "", components[k])
            if key not in oracle.row:
                assert not getattr(row, f"by_{axis}")
                continue
            unit = DEGREE if row.observation == "attitude" else 1.0
            at = oracle.row[key]
            sigma = oracle.factor * np.sqrt(d.covariance[at, at])
            same(getattr(row, f"sigma_{axis}") * unit, sigma, "σ of an observation")
            # What its σ changes the parameter by, in σ of that.
            scale = sigma / oracle.spread[oracle.free[name]]
            found.append(getattr(row, f"by_{axis}") * oracle.unit_of(name) / unit * scale)
            expected.append(gain[oracle.free[name], at] * scale)
    same(found, expected, "influences", of=np.ones(len(found)))


class Alternatives:
    """C = dv/db of the alternatives of the model that are listed, SI, over all scalars."""

    def __init__(self, oracle: Oracle) -> None:
        self.oracle, self.block = oracle, oracle.block
        keys = oracle.dense.keys
        self.group, self.image, self.point, self.component = (
            np.array(part) for part in zip(*keys, strict=True)
        )
        images = oracle.results.table("images").set_index("image")
        self.heading = images.loc[self.block.images, "heading_deg"].to_numpy()
        self.of_image = oracle.dense.image_of_row()

    def column(self, row: pd.Series) -> Array | None:
        """Of one row of the table; None where it is not computed here."""
        quantity, entity = str(row["quantity"]), str(row["entity"])
        if quantity in ("convergence", "angle_order"):
            return None
        if quantity == "refraction":
            column = np.zeros(len(self.group))
            # At the delivered orientations, with the heights of the adjusted points.
            k = coefficient(self.block.refraction.height, self.block.map_of_point[self.block.ray_point, 2])
            bent = replace(self.block.refraction, k=k).bent(self.block.xy)
            column[: bent.size] = (bent - self.block.xy).ravel()
            return column
        for prefix, group in SINGLE.items():
            if quantity.startswith(prefix):
                own = (self.group == group) & (self.component == quantity.removeprefix(prefix))
                return (own & ((self.image == entity) | (self.point == entity))).astype(float)
        if quantity.startswith("control_"):
            return self._of_control(quantity)
        if quantity.startswith(("gnss_drift", "ins_drift")):
            group = "gnss_positions" if quantity.startswith("gnss") else "ins_attitudes"
            own = (self.group == group) & (self.component == quantity.split("_")[-1]) & self._part(row)
            if group == "gnss_positions" and self.block.project["project"]["crs"] != "local":
                return None
            return np.where(own, self.block.since_mid[self.of_image], 0.0)
        if quantity == "time_offset":
            speed = turned(np.swapaxes(self.block.antenna_axes, 1, 2), self.block.speed)
            axis = np.array(["xyz".find(name) for name in self.component])
            column = np.where(self.group == "gnss_positions", speed[self.of_image, axis], 0.0)
            if "rate_roll" in self.block.given:
                rate = np.radians(self.block.given[[f"rate_{name}" for name in BODY]].to_numpy())
                turns = self.group == "ins_attitudes"
                about_axis = [BODY.index(name) for name in self.component[turns]]
                column[turns] = rate[self.of_image[turns], about_axis]
            return column
        if (quantity, entity) not in self.block.number and quantity.startswith("brown:"):
            x0 = self.block.of(self.block.g, X0, self.block.ray_camera)
            terms = brown(self.block.xy - x0)[:, :, BROWN.index(quantity.removeprefix("brown:"))]
            column = np.zeros(len(self.group))
            own = np.array([camera == entity for camera in self.block.ray_camera])
            column[: terms.size] = -(terms * own[:, None]).ravel()
            return column
        entities = [entity] if entity else sorted(set(self.block.flight))
        first = len(self.oracle.dense.x0) - len(self.block.g)
        whole = sum(self.oracle.dense.derivative(first + self.block.number[quantity, e]) for e in entities)
        return np.asarray(whole * self._part(row))

    def _part(self, row: pd.Series) -> Array:
        """Which scalars belong to images of the part."""
        if row["scope"] == "all":
            return np.ones(len(self.group), dtype=bool)
        if row["scope"] == "strip":
            own = np.array([strip == row["part"] for strip in self.block.strip])
        else:
            assert row["scope"] == "direction"
            apart = np.radians(self.heading - float(str(row["part"]).removesuffix("°")))
            own = np.cos(apart) > np.cos(np.radians(45.0))
        return np.asarray(own[self.of_image] & (self.of_image >= 0))

    def _of_control(self, quantity: str) -> Array:
        block = self.block
        names = list(block.surveyed.index)
        number = [block.point_number[name] for name in names]
        place, height = block.place[number], block.map_of_point[number, 2]
        enu = block.frame.enu(block.map_of_point[number][:1])[0]
        east, north, _ = ((place - place.mean(axis=0)) @ enu).T
        nil, one = np.zeros(len(names)), np.ones(len(names))
        change = {
            "control_shift_x": (one, nil, nil),
            "control_shift_y": (nil, one, nil),
            "control_shift_z": (nil, nil, one),
            "control_tilt_east": (nil, nil, east),
            "control_tilt_north": (nil, nil, north),
            "control_turn": (north, -east, nil),
            "control_scale": (east, north, nil),
            "control_height_scale": (nil, nil, height - height.mean()),
        }[quantity]
        by_name = {(n, "xyz"[k]): change[k][i] for i, n in enumerate(names) for k in range(3)}
        of_control = self.group == "control_points"
        return np.array(
            [
                by_name[p, c] if own else 0.0
                for p, c, own in zip(self.point, self.component, of_control, strict=True)
            ]
        )


BODY = ("roll", "pitch", "yaw")
X0 = ("principal_point_x", "principal_point_y")
SINGLE = {
    "control_point_": "control_points",
    "gnss_position_": "gnss_positions",
    "ins_attitude_": "ins_attitudes",
}


def test_alternatives_of_the_model(oracle: Oracle) -> None:
    d, block = oracle.dense, oracle.block
    table = oracle.results.table("model_alternatives").fillna({"entity": "", "part": ""})
    listed = Alternatives(oracle)
    columns = [listed.column(row) for _, row in table.iterrows()]
    table = table[[column is not None for column in columns]].reset_index(drop=True)
    c = np.stack([column for column in columns if column is not None], axis=1)[d.used]
    assert len(table) > 40
    weighted = d.p @ c
    across = d.a.T @ weighted
    score = -(weighted.T @ d.v - across.T @ (d.q @ (d.a.T @ d.p @ d.v)))
    normal, alone = np.diagonal(c.T @ weighted - across.T @ d.q @ across), np.einsum("ij,ij->j", c, weighted)
    told = normal > 1e-6 * alone
    np.testing.assert_array_equal(table["estimate"].notna(), told)
    unit = table["unit"].map(lambda name: UNITS.get(name, 1.0)).to_numpy()
    sigma = max(1.0, d.sigma0) / np.sqrt(normal[told]) / unit[told]
    t = score[told] / np.sqrt(normal[told]) / max(1.0, d.sigma0)
    of = np.maximum(1.0, np.abs(t))
    same(table["sigma"][told], sigma, "σ of alternatives", tolerance=1e-5)
    same(table["t"][told], t, "t of alternatives", of=of, tolerance=1e-4)
    same(table["estimate"][told] / sigma, t, "estimates of alternatives", of=of, tolerance=1e-4)
    effects = oracle.results.table("model_alternative_effects").fillna({"entity": "", "part": ""})
    key = ["quantity", "entity", "scope", "part"]
    place = {name: k for k, name in enumerate(table[key].itertuples(index=False, name=None))}
    moved = d.q @ across
    found, expected = list[float](), list[float]()
    for row in effects.to_dict("records"):
        name, parameter = tuple(row[k] for k in key), (row["parameter"], row["parameter_entity"])
        if name in place:
            k, column = place[name], oracle.free[parameter]
            size = unit[k] / (np.sqrt(normal[k]) if told[k] else np.sqrt(alone[k]))
            found.append(row["effect"] * oracle.unit_of(parameter) / unit[k] / oracle.spread[column])
            expected.append(moved[column, k] / oracle.spread[column])
            found[-1], expected[-1] = found[-1] * size, expected[-1] * size
    same(found, expected, "effects", of=np.maximum(1.0, np.abs(expected)), tolerance=1e-4)
    assert {name for name in block.number if block.free[block.number[name]]} >= set(
        zip(effects["parameter"], effects["parameter_entity"], strict=True)
    )


def test_what_holds_the_datum(oracle: Oracle) -> None:
    d, block = oracle.dense, oracle.block
    middle, n = block.centre.mean(axis=0), len(block.images)
    images, points = np.swapaxes(block.image_axes, 1, 2), np.swapaxes(block.point_axes, 1, 2)
    attitude, movements = block.image_axes @ opk(block.angles), list[Array]()
    for k in range(7):
        exposure, axis = np.zeros((n, 6)), np.eye(3)[k % 3]
        ends = [block.centre - middle, block.place - middle]
        if k < 3:
            ends = [np.broadcast_to(axis, end.shape) for end in ends]
        elif k < 6:
            ends = [np.cross(axis, end) for end in ends]
            turns = [about(k - 3, np.array(step)) for step in (1e-5, -1e-5)]
            ahead, behind = (angles_of(images @ turn @ attitude) for turn in turns)
            exposure[:, 3:] = (np.remainder(ahead - behind + np.pi, 2 * np.pi) - np.pi) / 2e-5
        exposure[:, :3] = turned(images, ends[0])
        movements.append(np.concatenate([exposure.ravel(), turned(points, ends[1]).ravel()]))
    change = d.a[:, : oracle.border] @ np.stack(movements, axis=1)
    group = np.array([key[0].split(":")[0] for key in oracle.keys])
    rays = group == "image_points"
    information = change * (d.p @ np.where(rays[:, None], 0.0, change))
    for k, figure in enumerate(oracle.results.summary["datum"]):
        total = information[~rays, k].sum()
        same(figure["sigma"], 1.0 / np.sqrt(total), figure["direction"], tolerance=1e-6)
        for name, share in figure["held_by"].items():
            same(share, information[group == name, k].sum() / total, name, tolerance=1e-6)


def test_variance_components(oracle: Oracle) -> None:
    components, d = oracle.results.summary["variance_components"], oracle.dense
    if components is None:
        assert np.array_equal(
            d.sigma, np.sqrt(np.concatenate([np.diagonal(g.covariance) for g in d.d.groups]))
        )
        return
    part = np.array([part_of(key) for key in oracle.keys])
    squares = d.v * (d.p @ d.v)
    estimated = [item for item in components["components"] if item["estimated"]]
    assert len(estimated) >= 3
    for item in components["components"]:
        own = part == item["part"]
        same(item["redundancy"], oracle.redundancy[own].sum(), "r of a part")
        assert item["estimated"] == (item["redundancy"] >= 10.0)
        if item["estimated"]:
            # At the fixed point Ω = r; the rest is a small part of the σ of the factor, 1/√(2 r).
            rest = squares[own].sum() / item["redundancy"] - 1.0
            assert abs(rest) / 2.0 < 0.02 / np.sqrt(2.0 * item["redundancy"])
    # Those of log σ̂² = 2 d⁻¹ = (2 S⁻¹)_gg.
    freedom = 2.0 / Likelihood(oracle).spread ** 2
    share = 0.5 * (1.0 - components["confidence"])
    for item, expected in zip(estimated, freedom, strict=False):  # correlation times follow
        # Traces by random signs.
        assert item["degrees_of_freedom"] == pytest.approx(expected, rel=0.15)
        own = item["degrees_of_freedom"]
        limits = item["factor"] * np.sqrt(own / stats.chi2.ppf([1.0 - share, share], own))
        same([item["factor_lower"], item["factor_upper"]], limits, "limits of a factor")


def image_residuals(oracle: Oracle) -> pd.DataFrame:
    """Residuals of image points (µm) and where they are (mm), one row for each."""
    table = oracle.residuals.reset_index()
    table = table[table["group"] == "image_points"]
    wide = table.pivot_table(index=["image", "point"], columns="component", values=["residual", "redundancy"])
    wide.columns = [f"{name}_{axis}" for name, axis in wide.columns]
    places = oracle.results.table("image_points").set_index(["image", "point"])
    return wide.join(places[["x_mm", "y_mm"]])


def test_mean_residuals(oracle: Oracle) -> None:
    rays, grid = image_residuals(oracle), oracle.results.table("residual_grid")
    tested = 0
    for cell in grid.to_dict("records"):
        inside = np.abs(rays["x_mm"] - cell["x_mm"]) <= cell["width_mm"] / 2
        inside &= np.abs(rays["y_mm"] - cell["y_mm"]) <= cell["height_mm"] / 2
        counted = {axis: rays[inside & (rays[f"redundancy_{axis}"] > 0.2)] for axis in "xy"}
        for axis, own in counted.items():
            assert cell[f"count_v{axis}"] == len(own)
            v = own[f"residual_{axis}"]
            mean, sigma = (v.mean(), v.std() / np.sqrt(len(v))) if len(v) >= 5 else (np.nan, np.nan)
            np.testing.assert_allclose(cell[f"mean_v{axis}_um"], mean, rtol=1e-9)
            np.testing.assert_allclose(cell[f"sigma_v{axis}_um"], sigma, rtol=1e-9)
        numbers = np.array([len(counted[axis]) for axis in "xy"])
        if numbers.min() < 5:
            continue
        both = counted["x"].loc[counted["x"].index.intersection(counted["y"].index)]
        mean = np.array([cell["mean_vx_um"], cell["mean_vy_um"]])
        variance = np.array([cell["sigma_vx_um"], cell["sigma_vy_um"]]) ** 2
        apart = both[["residual_x", "residual_y"]].to_numpy() - mean
        mixed = np.sum(apart[:, 0] * apart[:, 1]) / (len(both) - 1) * len(both) / numbers.prod()
        c = np.array([[variance[0], mixed], [mixed, variance[1]]])
        n = stats.hmean(numbers)
        square = mean @ np.linalg.solve(c, mean)
        expected = stats.f.sf(square * (n - 2) / (2 * (n - 1)), 2, n - 2)
        np.testing.assert_allclose(cell["p_value"], expected, rtol=1e-7)
        assert cell["significant"] == (expected < 0.05)
        tested += 1
    assert tested
    (figure,) = oracle.results.summary["residual_grid"]["cameras"]
    for k, axis in enumerate("xy"):
        rms = float(np.sqrt((grid[f"mean_v{axis}_um"] ** 2).mean()))
        noise = float(np.sqrt((grid[f"sigma_v{axis}_um"] ** 2).mean()))
        signal = np.sqrt(max(rms**2 - noise**2, 0.0))
        found = [figure[name][k] for name in ("rms_um", "noise_um", "signal_um")]
        np.testing.assert_allclose(found, [rms, noise, signal], rtol=1e-9, atol=1e-12)
        assert figure["residuals"][k] == grid[f"count_v{axis}"].sum()
    assert figure["significant"] == grid["significant"].sum()


def test_correlation_of_neighbouring_residuals(oracle: Oracle) -> None:
    rays, table = image_residuals(oracle), oracle.results.table("residual_autocorrelation")
    for axis, classes in table.groupby("component"):
        counted = rays[rays[f"redundancy_{axis}"] > 0.2]
        in_image = counted.groupby("image").size()
        typical = (in_image**2).sum() / in_image.sum()  # an image weighs with its pairs
        values, products = counted[f"residual_{axis}"], list[Array]()
        for _, own in counted.groupby("image"):
            i, j = np.triu_indices(len(own), 1)
            place, v = own[["x_mm", "y_mm"]].to_numpy(), values[own.index].to_numpy()
            products.append(np.column_stack([np.linalg.norm(place[i] - place[j], axis=1), v[i] * v[j]]))
        distance, product = np.vstack(products).T
        for row in classes.to_dict("records"):
            own = (distance > row["distance_from_mm"]) & (distance <= row["distance_to_mm"])
            assert row["pairs"] == own.sum()
            if own.any():
                correlation = product[own].mean() / (values**2).mean()
                np.testing.assert_allclose(row["correlation"], correlation, rtol=1e-6, atol=1e-9)
                np.testing.assert_allclose(row["limit"], 3.0 / np.sqrt(own.sum()) + 6.0 / typical, rtol=1e-6)
                relative = np.sqrt(2.0 * (1.0 - correlation) * (values**2).mean())
                np.testing.assert_allclose(row["sigma_relative_um"], relative, rtol=1e-6)
                assert row["correlated"] == (abs(row["correlation"]) > row["limit"])


def test_self_calibration(oracle: Oracle) -> None:
    offered = [name for name in oracle.free if ":" in name[0]]
    if not offered:
        assert not (oracle.results.folder / "self_calibration.parquet").exists()
        return
    table = oracle.results.table("self_calibration")
    assert set(named(table)) == set(offered)
    q = oracle.dense.q[oracle.border :, oracle.border :]
    correlation = q / np.outer(oracle.spread[oracle.border :], oracle.spread[oracle.border :])
    names, inverse_diagonal = list(oracle.free), np.diagonal(np.linalg.inv(correlation))
    adjusted = oracle.results.table("parameters").set_index(["parameter", "entity"])
    for row in table.to_dict("records"):
        name = (row["parameter"], row["entity"])
        k = names.index(name)
        for ours, theirs in (("value", "value"), ("sigma", "sigma"), ("t", "t"), ("t_of_all", "t")):
            np.testing.assert_allclose(row[ours], adjusted.loc[name, theirs], rtol=1e-6, err_msg=ours)
        others = np.where(np.arange(len(names)) == k, 0.0, correlation[k])
        strongest = int(np.argmax(np.abs(others)))
        np.testing.assert_allclose(row["strongest_correlation"], others[strongest], rtol=1e-5, atol=1e-9)
        assert (row["correlated_parameter"], row["correlated_entity"]) == names[strongest]
        together = np.sqrt(1.0 - 1.0 / inverse_diagonal[k])
        np.testing.assert_allclose(row["total_correlation"], together, rtol=1e-5)
