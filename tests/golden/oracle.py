"""A simulated flight adjusted by the command, and its dense solution at the adjusted values."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np
import pandas as pd

from flows.runs.project_run import RunRequest, Story, carry_out
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.flows.adjustment_alone import adjustment_alone
from tests.golden.delivered_block import Array, Delivered, ProjectedFrame, Results, Solved

SMALL = ("points.count=30", "control.columns=5", "control.rows=4", "control.control=9")
DELTA0 = 4.132
Key = tuple[str, str, str, str]


@dataclass(frozen=True)
class Case:
    """Changes of the simulated flight, of its delivered tables and of the adjustment."""

    simulated: tuple[str, ...]
    changed: Callable[[Path], None]
    adjusted: tuple[str, ...]


#: Errors of GNSS and INS that last two exposures.
CORRELATED = (
    "noise.gnss_m=[0,0,0]",
    "noise.gnss_markov_m=[0.05,0.05,0.06]",
    "noise.gnss_correlation_s=20",
    "noise.ins_deg=[0,0,0]",
    "noise.ins_markov_deg=[0.003,0.003,0.008]",
    "noise.ins_correlation_s=15",
)


def nothing(_: Path) -> None:
    """The delivery as it is."""


def with_own_sigmas(folder: Path) -> None:
    """A σ of its own for every coordinate and angle; control in plan only, and in height only."""
    rng = np.random.default_rng(1)

    def stated(file: str, names: tuple[str, ...], low: float, high: float) -> pd.DataFrame:
        table = pd.read_csv(folder / file, dtype={"point": str})
        return table.assign(**{name: rng.uniform(low, high, len(table)).round(6) for name in names})

    control = stated("control.csv", ("sx", "sy", "sz"), 0.01, 0.05)
    rows = control.index[control["role"] == "control"]
    control.loc[rows[1:3], ["x", "y"]] = np.nan
    control.loc[rows[4:6], "z"] = np.nan
    control.to_csv(folder / "control.csv", index=False)
    exposures = stated("exposures.csv", ("sx", "sy", "sz"), 0.03, 0.08)
    exposures[["somega", "sphi", "skappa"]] = rng.uniform(0.002, 0.008, (len(exposures), 3)).round(6)
    exposures.to_csv(folder / "exposures.csv", index=False)
    stated("image_points.csv", ("sx", "sy"), 0.0008, 0.0016).to_csv(folder / "image_points.csv", index=False)


def with_distances(folder: Path, count: int = 12, in_order: int = 12) -> None:
    """Measured distances of points of three and more images, a quarter of them for check.

    Parameters
    ----------
    in_order : how many places the two ends are apart among the names.
    """
    project = folder / "project.toml"
    seen = pd.read_csv(folder / "image_points.csv", dtype=str)["point"].value_counts()
    truth = pd.read_parquet(folder / "truth" / "object_points.parquet").set_index("point")
    names = sorted(set(seen.index[seen >= 3]) & set(truth.index))
    place = truth.loc[names, ["x_m", "y_m", "z_m"]].to_numpy()
    if (crs := tomllib.loads(project.read_text())["project"]["crs"]) != "local":
        place = ProjectedFrame(crs, place).local(place)
    rng = np.random.default_rng(5)
    one = np.arange(count) % len(names)
    other = (one + in_order + np.arange(count) // len(names)) % len(names)
    sigma = rng.uniform(0.005, 0.02, count).round(4)
    length = np.linalg.norm(place[other] - place[one], axis=1) + sigma * rng.normal(size=count)
    table = pd.DataFrame({"distance": (length * 1e3).round(3), "sigma": sigma * 1e3})
    table["point"], table["other_point"] = np.array(names)[one], np.array(names)[other]
    table["role"] = np.where(np.arange(count) % 4 == 3, "check", "control")
    table.to_csv(folder / "distances.csv", index=False)
    added = '\n[inputs.distances]\nfile = "distances.csv"\nunit = "mm"\n'
    project.write_text(project.read_text() + added)


def with_own_sigmas_and_distances(folder: Path) -> None:
    """Both."""
    with_own_sigmas(folder)
    with_distances(folder)


def simulated(folder: Path, preset: str, settings: Sequence[str], seed: int = 3) -> Path:
    """The project file of a simulated flight."""
    return simulate_project(load_simulation(preset, tuple(settings), seed), folder).project_file


def computed(
    project: Path, settings: Sequence[str] = (), story: Story = adjustment_alone, into: str = "results"
) -> Results:
    """The results of a story, in a folder next to the project file."""
    found = carry_out(story, RunRequest(project, project.parent / into, tuple(settings)))
    assert found.error is None, found.error
    return Results(found.directory)


@dataclass(frozen=True, eq=False)
class Oracle:
    """A delivered block, its published results, and the dense solution at the adjusted values."""

    results: Results
    block: Delivered
    dense: Solved

    @classmethod
    def of(cls, project: Path, results: Results, kind: type[Delivered] = Delivered) -> Oracle:
        table = results.table("residuals").fillna({"image": "", "point": ""})
        status = table.set_index(["group", "image", "point", "component"])["status"].to_dict()
        block = kind(project, results)
        return cls(results, block, Solved(block, lambda key: status[key] in ("used", "uncontrolled")))

    @classmethod
    def of_case(cls, case: Case, folder: Path) -> Oracle:
        """Of a flight that is simulated in a folder, and adjusted there."""
        project = simulated(folder, "uce-high", (*SMALL, *case.simulated))
        case.changed(project.parent)
        return cls.of(project, computed(project, case.adjusted))

    @cached_property
    def keys(self) -> list[Key]:
        """Of the scalars used."""
        return [key for key, used in zip(self.dense.keys, self.dense.used, strict=True) if used]

    @cached_property
    def row(self) -> dict[Key, int]:
        return {key: k for k, key in enumerate(self.keys)}

    @cached_property
    def residuals(self) -> pd.DataFrame:
        table = self.results.table("residuals").fillna({"image": "", "point": ""})
        return table.set_index(["group", "image", "point", "component"]).loc[self.keys]

    @property
    def factor(self) -> float:
        return float(self.results.summary["sigma_scaled_by"])

    @cached_property
    def scatter(self) -> Array:
        """P Q_vv P."""
        return self.dense.p - self.fitted

    @cached_property
    def fitted(self) -> Array:
        """P A Q Aᵀ P."""
        d = self.dense
        return np.asarray(d.p @ d.a @ d.q @ d.a.T @ d.p)

    @cached_property
    def redundancy(self) -> Array:
        return np.einsum("ij,ji->i", self.dense.covariance, self.scatter)

    @property
    def first_point(self) -> int:
        return 6 * len(self.block.images)

    @property
    def border(self) -> int:
        return self.first_point + 3 * len(self.block.points)

    @cached_property
    def free(self) -> dict[tuple[str, str], int]:
        """Columns of the system parameters that are estimated."""
        names = [name for name, k in self.block.number.items() if self.block.free[k]]
        return {name: self.border + k for k, name in enumerate(names)}

    def unit_of(self, name: tuple[str, str]) -> float:
        return float(self.block.factor[self.block.number[name]])

    @cached_property
    def spread(self) -> Array:
        """√q of all unknowns."""
        return np.sqrt(np.diagonal(self.dense.q))


def same(found: object, expected: object, name: str, of: object = None, tolerance: float = 2e-6) -> None:
    """Agreement relative to ``of``, or to what is expected."""
    ours, theirs = np.asarray(expected, dtype=float), np.asarray(found, dtype=float)
    scale = np.abs(ours) if of is None else np.asarray(of, dtype=float)
    assert ours.shape == theirs.shape, name
    assert ours.size, name
    beyond = np.abs(theirs - ours) > tolerance * scale + 1e-13
    assert not beyond.any(), f"{name}: {theirs[beyond][:5]} instead of {ours[beyond][:5]}"


#: As much as local frames permit: projections of a map leave 1e-5 of a σ.
exactly = partial(same, tolerance=1e-8)
