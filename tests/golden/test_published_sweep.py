"""Every scenario of a sweep by a dense adjustment of its own, from the delivered files."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunRequest
from flows.stories.scenario_sweep import sweep_of
from tests.golden.delivered_block import Results, Solved
from tests.golden.dense_adjustment import at_minimum
from tests.golden.oracle import SMALL, computed, exactly, simulated

POINTS = ("C001", "C005", "C011", "C016", "C020")
FREE = ("boresight", "gnss_shift", "focal_length")
SWEEP = (
    'sweep.blocks={all="all", three={strips=["E*", "N01"]}}',
    f'sweep.control={{delivered="delivered", five={list(POINTS)}}}',
    f'sweep.variants={{held={{}}, free={{"adjustment.free"={list(FREE)}}}}}',
    "sweep.workers=1",
)


@dataclass(frozen=True, eq=False)
class Swept:
    """A project, the results of its adjustment, and the table of its sweep."""

    project: Path
    first: Results
    table: pd.DataFrame

    def dense(self, block: str, control: str, variant: str) -> Solved:
        """A scenario, from the adjustment of the whole block."""
        folder = self.project.parent
        text = self.project.read_text()
        if variant == "free":
            text = re.sub(r"free = \[.*?\]", f"free = {list(FREE)}".replace("'", '"'), text)
        if control == "five":
            given = pd.read_csv(folder / "control.csv", dtype={"point": str})
            roles = np.where(given["point"].isin(POINTS), "control", "check")
            given.assign(role=roles).to_csv(folder / "five.csv", index=False)
            text = text.replace("control.csv", "five.csv")
        scenario = folder / "scenario.toml"
        scenario.write_text(text)
        images = self.first.table("exterior_orientations")
        if block == "three":
            images = images[~images["image"].str.startswith("N02")]
        rays = pd.read_csv(folder / "image_points.csv", dtype=str)
        rays = rays[rays["image"].isin(images["image"])]
        seen = rays["point"].value_counts()
        points = self.first.table("object_points")
        points = points[points["point"].isin(seen.index[seen >= 2])]
        parameters = self.first.table("parameters")
        if variant == "free":
            parameters.loc[parameters["parameter"] == "focal_length", "status"] = "significant"
        tables = {"exterior_orientations": images, "object_points": points, "parameters": parameters}
        tables = {name: table.reset_index(drop=True) for name, table in tables.items()}
        return at_minimum(scenario, self.first.folder, tables)


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Swept:
    project = simulated(tmp_path_factory.mktemp("sweep"), "uce-high", SMALL)
    story = sweep_of(RunRequest(project, project.parent / "sweep", SWEEP))
    return Swept(project, computed(project), computed(project, SWEEP, story, "sweep").table("sweep"))


SCENARIOS = list(product(("all", "three"), ("delivered", "five"), ("held", "free")))


@pytest.mark.parametrize("scenario", SCENARIOS, ids="-".join)
def test_scenarios(swept: Swept, scenario: tuple[str, str, str]) -> None:
    d, row = swept.dense(*scenario), swept.table.set_index(["block", "control", "variant"]).loc[scenario]
    block = d.d
    role = block.control["role"].to_numpy()
    expected = {
        "sigma0": d.sigma0,
        "sigma0_um": d.sigma0 * 1.05,
        "redundancy": d.redundancy,
        "images": len(block.images),
        "object_points": len(block.points),
        "image_points": len(block.rays),
        "rejected": 0,
        "control_points": len(block.surveyed),
        "check_points": (role == "check").sum(),
        "number": SCENARIOS.index(scenario) + 1,
        "parameters_offered": 0,
        "cells_by_chance": 0.05 * row["cells"],
    }
    first = swept.table.set_index(["block", "control", "variant"]).loc[(*scenario[:2], "held"), "sigma0"]
    expected["sigma0_ratio"] = d.sigma0 / first
    n, q = len(block.images), d.sigma0**2 * np.diagonal(d.q)
    image = d.v[: 2 * len(block.rays)].reshape(-1, 2) * 1e6
    for k, axis in enumerate("xyz"):
        if k < 2:
            expected[f"image_rms_{axis}_um"] = np.sqrt((image[:, k] ** 2).mean())
        for name, chosen in (("control", role != "check"), ("check", role == "check")):
            points = [point for point in block.control.index[chosen] if point in block.point_number]
            number = [block.point_number[point] for point in points]
            apart = block.place[number, k] - block.control.loc[points, axis].to_numpy()
            expected[f"rmse_{name}_{axis}_m"] = np.sqrt((apart**2).mean())
            expected[f"max_{name}_{axis}_m"] = np.abs(apart).max()
        variance = q[6 * n + 3 * np.array(number) + k] + block.survey_sigma.loc[points].iloc[:, k] ** 2
        expected[f"predicted_check_{axis}_m"] = np.sqrt(variance.mean())
    ground = pd.Series(block.place[block.ray_point, 2]).groupby(block.ray_image).mean()
    expected["gsd_m"] = np.median(block.centre[:, 2] - ground) * 5.2e-6 / 0.080
    for name, value in expected.items():
        # Of the ground sampling distance by approximate values.
        exactly(row[name], value, name, tolerance=1e-3 if name == "gsd_m" else 1e-6)
    assert row["status"] == "done"


def test_mean_residuals_are_those_of_the_adjustment(swept: Swept) -> None:
    """Of the scenario that is the project itself; see test_published_statistics."""
    (figure,) = swept.first.summary["residual_grid"]["cameras"]
    row = swept.table.set_index(["block", "control", "variant"]).loc["all", "delivered", "held"]
    assert (row["cells"], row["cells_significant"]) == (figure["known"], figure["significant"])
    exactly(
        row[["systematic_x_um", "systematic_y_um"]], figure["signal_um"], "systematic part", tolerance=1e-9
    )
