"""Every figure of the direct-georeferencing check by dense algebra, from delivered files and a calibration.

Orientations follow from GNSS, INS and calibration alone; formulas: docs/direct-georeferencing.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.linalg
from scipy import stats

from flows.stories.direct_georeferencing_check import direct_georeferencing_check
from tests.golden.delivered_block import (
    ANGLES,
    DEGREE,
    PLACE,
    STEP,
    Applied,
    Array,
    Delivered,
    Results,
    Solved,
    angles_of,
    mounting,
    named,
    rpy,
    turned,
)
from tests.golden.oracle import computed, simulated

FLIGHT = (
    "points.count=30",
    "control.columns=5",
    "control.rows=4",
    "control.control=8",
    'project.free=["boresight", "gnss_shift", "gnss_strip_bias", "focal_length", "principal_point"]',
    "truth.strip_bias_m=[0.03,0.03,0.05]",
)
BODY = ("roll", "pitch", "yaw")


@dataclass(frozen=True, eq=False)
class Check:
    """A check with its calibration, and the sensitivities of intersected points to all sources of error."""

    project: Path
    results: Results
    calibration: Results

    @cached_property
    def parameters(self) -> pd.DataFrame:
        table = self.calibration.table("parameters")
        return table[table["strip"].isna()].reset_index(drop=True)

    @cached_property
    def block(self) -> Delivered:
        names = {"image": str, "strip": str, "flight": str, "camera": str}
        given = pd.read_csv(self.project.parent / "exposures.csv", dtype=names).sort_values("image")
        value = dict(zip(named(self.parameters), self.parameters["value"], strict=True))

        def of(family: str, axes: tuple[str, ...], entities: pd.Series) -> Array:
            return np.array([[value.get((f"{family}_{a}", e), 0.0) for a in axes] for e in entities])

        enu_from_ned = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
        body = enu_from_ned @ rpy(np.radians(given[["roll", "pitch", "heading"]].to_numpy()))
        attitude = body @ rpy(np.radians(of("boresight", BODY, given["camera"]))) @ mounting(0)
        lever, shift = (
            of("lever_arm", tuple("xyz"), given["camera"]),
            of("gnss_shift", tuple("xyz"), given["flight"]),
        )
        centre = given[["x", "y", "z"]].to_numpy() - turned(body, lever) - shift
        columns = np.hstack([centre, np.degrees(angles_of(attitude))])
        orientations = pd.DataFrame(columns, columns=[*PLACE, *ANGLES]).assign(
            image=given["image"].to_numpy()
        )
        tables = {"exterior_orientations": orientations, "object_points": self.points}
        return Delivered(self.project, Applied(self.results.folder, tables | {"parameters": self.parameters}))

    @cached_property
    def points(self) -> pd.DataFrame:
        return self.results.table("direct_georeferencing")

    @cached_property
    def dense(self) -> Solved:
        return Solved(self.block, lambda _: True)

    def rows(self, *groups: str) -> Array:
        return np.flatnonzero([key[0] in groups for key in self.dense.keys])

    @cached_property
    def observed(self) -> Array:
        return self.rows("gnss_positions", "ins_attitudes")

    @cached_property
    def estimated(self) -> list[tuple[str, str]]:
        return [name for name, k in self.block.number.items() if self.block.free[k]]

    @cached_property
    def by_observations(self) -> Array:
        """A_EO⁻¹ of positions and attitudes."""
        orientation = 6 * len(self.block.images)
        return np.linalg.inv(self.dense.all_a[np.ix_(self.observed, np.arange(orientation))])

    def sensitivity(self, places: Sequence[tuple[str, frozenset[str]]]) -> tuple[Array, Array, Array]:
        """Of points in some images to image coordinates, to positions and attitudes, and to the calibration.

        dEO = A_EO⁻¹ (dl − A_p dp); dX = −(A_Xᵀ P A_X)⁻¹ A_Xᵀ P (A_EO dEO + A_p dp − dl).
        """
        a, orientation = self.dense.all_a, 6 * len(self.block.images)
        of_parameters = a[:, orientation + 3 * len(self.block.points) :]
        by_parameters = -self.by_observations @ of_parameters[self.observed]
        rays, found = self.rows("image_points"), list[tuple[Array, Array, Array]]()
        keys = self.dense.keys
        for name, images in places:
            own = np.array([k for k in rays if keys[k][2] == name and keys[k][1] in images])
            first = orientation + 3 * self.block.point_number[name]
            a_x, weight = a[own, first : first + 3], 1.0 / self.dense.sigma[own] ** 2
            solution = np.linalg.solve(a_x.T @ (weight[:, None] * a_x), a_x.T * weight)
            of_rays = np.zeros((3, len(rays)))
            of_rays[:, own] = solution  # image points are the first rows
            of_orientation = a[own, :orientation]
            total = of_orientation @ by_parameters + of_parameters[own]
            found.append((of_rays, -solution @ of_orientation @ self.by_observations, -solution @ total))
        return tuple(np.vstack(part) for part in zip(*found, strict=True))  # type: ignore[return-value]

    @property
    def with_all_rays(self) -> list[tuple[str, frozenset[str]]]:
        return [(name, frozenset(self.block.images)) for name in self.points["point"]]

    def parts(self, places: Sequence[tuple[str, frozenset[str]]]) -> dict[str, Array]:
        """Covariances of points by source, with a calibration of another flight."""
        rays, observed, parameters = self.sensitivity(places)
        of_strips = observed @ self.strips
        survey = self.block.survey_sigma.loc[[name for name, _ in places]].to_numpy().ravel()
        return {
            "image_points": (rays * self.dense.sigma[self.rows("image_points")] ** 2) @ rays.T,
            "gnss_ins": observed @ self.noise @ observed.T,
            "strips": of_strips @ of_strips.T,
            "calibration": parameters @ self.known @ parameters.T,
            "survey": np.diag(survey**2),
        }

    @cached_property
    def noise(self) -> Array:
        """Covariance of positions and attitudes."""
        groups = {group.name: group.covariance for group in self.block.groups}
        return scipy.linalg.block_diag(groups["gnss_positions"], groups["ins_attitudes"])

    @cached_property
    def strips(self) -> Array:
        """Unit errors of the positions of each strip (n, 3 s), scaled by their σ."""
        stated = self.block.settings["priors"]["gnss_strip_bias_m"]
        keys = [self.dense.keys[k] for k in self.observed]
        strip = [self.block.strip[self.block.image_number[key[1]]] for key in keys]
        columns = [
            [sigma * (s == name and key[3] == axis) for s, key in zip(strip, keys, strict=True)]
            for name in sorted(set(strip))
            for axis, sigma in zip("xyz", stated, strict=True)
        ]
        return np.array(columns).T

    @cached_property
    def survey(self) -> Array:
        return self.block.survey_sigma.loc[self.points["point"]].to_numpy().ravel() ** 2

    @cached_property
    def known(self) -> Array:
        """Covariance of the parameters of the calibration."""
        table = self.parameters.set_index(["parameter", "entity"])
        sigma = np.array(
            [table.loc[name, "sigma"] * self.block.factor[self.block.number[name]] for name in self.estimated]
        )
        correlation, pairs = np.eye(len(sigma)), self.calibration.table("correlations")
        place = {name: k for k, name in enumerate(self.estimated)}
        for a, b, value in zip(named(pairs, "_a"), named(pairs, "_b"), pairs["correlation"], strict=True):
            if a in place and b in place:
                correlation[place[a], place[b]] = correlation[place[b], place[a]] = value
        return correlation * np.outer(sigma, sigma)

    @cached_property
    def taken(self) -> tuple[Array, Array]:
        """K: the parameters by positions and attitudes (p, n), and by surveyed coordinates (p, 3 c)."""
        place = {self.dense.keys[k]: n for n, k in enumerate(self.observed)}
        surveyed = {name: k for k, name in enumerate(self.points["point"])}
        of_observed = np.zeros((len(self.estimated), len(place)))
        of_survey = np.zeros((len(self.estimated), 3 * len(surveyed)))
        kinds = {"position": ("gnss_positions", "xyz"), "attitude": ("ins_attitudes", BODY)}
        for row in self.calibration.table("parameter_influences").to_dict("records"):
            name = (row["parameter"], row["entity"])
            unit, p = self.block.factor[self.block.number[name]], self.estimated.index(name)
            by = np.array([row[f"by_{axis}"] for axis in "xyz"]) * unit
            if row["observation"] in kinds:
                group, axes = kinds[row["observation"]]
                at = [place[group, row["name"], "", axis] for axis in axes]
                of_observed[p, at] = by / (DEGREE if row["observation"] == "attitude" else 1.0)
            elif row["observation"] == "control":
                of_survey[p, 3 * surveyed[row["name"]] + np.arange(3)] = by
        return of_observed, of_survey


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulated(tmp_path_factory.mktemp("flight"), "uce-high", FLIGHT, 2)


def checked(project: Path, calibration: str) -> Results:
    setting = f"direct_georeferencing.calibration={calibration}"
    return computed(project, (setting,), direct_georeferencing_check, f"with_{Path(calibration).name}")


def assert_as_computed(check: Check, parts: Mapping[str, Array]) -> None:
    """The table and the figures, from the covariances (3 n, 3 n) of all parts."""
    table, figures = check.points, check.results.summary["direct_georeferencing"]
    total = np.sum(list(parts.values()), axis=0)
    sigma = np.sqrt(np.diagonal(total)).reshape(-1, 3)
    difference = (
        table[list(PLACE)].to_numpy() - check.block.control.loc[table["point"], ["x", "y", "z"]].to_numpy()
    )
    for k, axis in enumerate("xyz"):
        np.testing.assert_allclose(table[f"d{axis}_m"], difference[:, k], atol=1e-9)
        np.testing.assert_allclose(table[f"sigma_d{axis}_m"], sigma[:, k], rtol=1e-7)
    for status, figure in (
        ("independent", figures),
        ("control_of_calibration", figures["at_control_of_calibration"]),
    ):
        own = np.flatnonzero(table["status"] == status)
        for k in range(3) if len(own) else ():
            at = np.ix_(3 * own + k, 3 * own + k)
            covariance, d = total[at], difference[own, k]
            variance = np.trace(covariance) / len(own)
            freedom = np.trace(covariance) ** 2 / np.trace(covariance @ covariance)
            low, high = np.sqrt(variance * stats.chi2.ppf([0.025, 0.975], freedom) / freedom)
            for name, value in {
                "points": len(own),
                "rmse_m": np.sqrt(np.mean(d**2)),
                "mean_m": d.mean(),
                "sd_m": d.std(ddof=1),
                "max_m": np.abs(d).max(),
                "predicted_rmse_m": np.sqrt(variance),
                "degrees_of_freedom": freedom,
                "predicted_low_m": low,
                "predicted_high_m": high,
                "predicted_mean_sigma_m": np.sqrt(covariance.sum()) / len(own),
            }.items():
                np.testing.assert_allclose(figure[name][k], value, rtol=1e-6, err_msg=name)
            for name, part in parts.items():
                mean = np.trace(part[at]) / len(own)
                value = np.sign(mean) * np.sqrt(np.abs(mean))
                np.testing.assert_allclose(
                    figure["predicted_parts_m"][name][k], value, rtol=1e-6, err_msg=name
                )


@pytest.fixture(scope="module")
def check_of_another(flight: Path, tmp_path_factory: pytest.TempPathFactory) -> Check:
    project = simulated(tmp_path_factory.mktemp("calibration"), "uce-high", FLIGHT, 1)
    adjusted = computed(project, into="calibration")
    return Check(flight, checked(flight, str(adjusted.folder)), adjusted)


def test_with_the_calibration_of_another_flight(check_of_another: Check) -> None:
    check = check_of_another
    assert_as_computed(check, check.parts(check.with_all_rays))


def test_points_in_single_models(check_of_another: Check) -> None:
    check, table = check_of_another, check_of_another.results.table("direct_georeferencing_models")
    images = [frozenset(pair) for pair in zip(table["left"], table["right"], strict=True)]
    places = list(zip(table["point"], images, strict=True))
    total = np.sum(list(check.parts(places).values()), axis=0)
    sigma = np.sqrt(np.diagonal(total)).reshape(-1, 3)
    # Two rays of a poor intersection meet away from where all of them do: first order in that distance.
    np.testing.assert_allclose(table[[f"sigma_d{axis}_m" for axis in "xyz"]], sigma, rtol=5e-3)


def test_with_the_adjustment_of_the_same_flight(flight: Path) -> None:
    results = checked(flight, "adjustment")
    check = Check(flight, results, results)
    _, observed, parameters = check.sensitivity(check.with_all_rays)
    of_strips, (gain, of_survey) = observed @ check.strips, check.taken
    strips = gain @ check.strips
    known = gain @ check.noise @ gain.T + strips @ strips.T + (of_survey * check.survey) @ of_survey.T
    # The adjustment scaled all standard deviations by σ0, the check takes them as they are stated.
    rest = check.known + (1.0 - results.summary["sigma0"] ** 2) * known
    shared = observed @ check.noise @ gain.T + of_strips @ strips.T - (of_survey * check.survey).T
    shared = shared @ parameters.T
    calibration = parameters @ rest @ parameters.T
    parts = check.parts(check.with_all_rays) | {"calibration": calibration, "shared": shared + shared.T}
    assert set(check.points["status"]) == {"independent", "control_of_calibration"}
    assert_as_computed(check, parts)


def test_y_parallaxes_and_what_predicts_them(check_of_another: Check) -> None:
    """p_y = −c (d_l × d_r)·B / (|B| (d_l·e_z) (d_r·e_z)), e_z across the base, near the mean camera axis."""
    check, block = check_of_another, check_of_another.block
    table = check.results.table("y_parallaxes")
    rays = pd.read_csv(block.folder / "image_points.csv", dtype=str).set_index(["image", "point"])
    ends = [np.array([block.image_number[name] for name in table[end]]) for end in ("left", "right")]
    measured = np.stack(
        [
            rays.loc[list(zip(table[end], table["point"], strict=True)), ["x", "y"]].to_numpy(float) * 1e-3
            for end in ("left", "right")
        ]
    )

    def parallaxes(exposure: Array, g: Array, xy: Array) -> Array:
        centre, attitude, _ = block.body(exposure, g)
        cameras = [block.camera[k] for k in ends[0]]
        c = block.of(g, ("focal_length",), cameras)
        x0 = block.of(g, ("principal_point_x", "principal_point_y"), cameras)
        base = centre[ends[1]] - centre[ends[0]]
        along = base / np.sqrt(np.sum(base * base, axis=1, keepdims=True))
        mean = attitude[ends[0], :, 2] + attitude[ends[1], :, 2]
        up = mean - along * np.sum(mean * along, axis=1, keepdims=True)
        up = up / np.sqrt(np.sum(up * up, axis=1, keepdims=True))
        left, right = (turned(attitude[e], np.hstack([q - x0, -c])) for e, q in zip(ends, xy, strict=True))
        volume = np.sum(np.cross(left, right) * along, axis=1)
        return np.asarray(-c[:, 0] * volume / (np.sum(left * up, axis=1) * np.sum(right * up, axis=1)))

    exposure = np.hstack([np.zeros((len(block.images), 3)), block.angles])
    found = parallaxes(exposure, block.g, measured)
    np.testing.assert_allclose(table["parallax_um"], found * 1e6, atol=1e-6)
    by_orientation = np.zeros((len(table), exposure.size))
    for end in (0, 1):
        for k in range(6):
            moved = exposure.astype(complex)
            # Of one end at a time: an image is the left one of one model, and the right one of another.
            column = np.zeros(len(table))
            for image in np.unique(ends[end]):
                moved[image, k] += 1j * STEP
                own = ends[end] == image
                column[own] = parallaxes(moved, block.g, measured)[own].imag / STEP
                moved[image, k] = exposure[image, k]
            by_orientation[np.arange(len(table)), 6 * ends[end] + k] += column
    by_parameters = np.zeros((len(table), len(check.estimated)))
    for n, name in enumerate(check.estimated):
        g = block.g.astype(complex)
        g[block.number[name]] += 1j * STEP
        by_parameters[:, n] = parallaxes(exposure, g, measured).imag / STEP
    variance = np.zeros(len(table))
    for end, axis in np.ndindex(2, 2):
        xy = measured.astype(complex)
        xy[end, :, axis] += 1j * STEP
        variance += (parallaxes(exposure, block.g, xy).imag / STEP * 1.05e-6) ** 2
    # A first-order prediction: derivatives change by the parallax over c, 2e-4 at most.
    np.testing.assert_allclose(table["sigma_image_um"], np.sqrt(variance) * 1e6, rtol=2e-4)
    observed = by_orientation @ check.by_observations
    of_parameters = check.dense.all_a[check.observed, exposure.size + 3 * len(block.points) :]
    parameters, strips = by_parameters - observed @ of_parameters, observed @ check.strips
    variance += np.einsum("ij,jk,ik->i", observed, check.noise, observed) + np.sum(strips**2, axis=1)
    variance += np.einsum("ij,jk,ik->i", parameters, check.known, parameters)
    np.testing.assert_allclose(table["sigma_um"], np.sqrt(variance) * 1e6, rtol=2e-4)
    figures, used = check.results.summary["direct_georeferencing"], (table["status"] == "used").to_numpy()
    assert figures["y_parallaxes"] == used.sum()
    squares = found[used] ** 2 * 1e12
    np.testing.assert_allclose(figures["y_parallax_rms_um"], np.sqrt(squares.mean()), rtol=1e-6)
    np.testing.assert_allclose(figures["y_parallax_max_um"], np.sqrt(squares.max()), rtol=1e-6)
    predicted = np.sqrt(variance[used].mean()) * 1e6
    np.testing.assert_allclose(figures["y_parallax_predicted_rms_um"], predicted, rtol=2e-4)
    models = check.results.table("stereo_models").set_index(["left", "right"])
    for name, own in table[used].groupby(["left", "right"]):
        assert models.loc[name, "points"] == len(own)
        of_model = {
            "rms_um": np.sqrt((own["parallax_um"] ** 2).mean()),
            "max_um": own["parallax_um"].abs().max(),
            "predicted_rms_um": np.sqrt((own["sigma_um"] ** 2).mean()),
        }
        for column, value in of_model.items():
            np.testing.assert_allclose(models.loc[name, column], value, rtol=1e-6, err_msg=column)
