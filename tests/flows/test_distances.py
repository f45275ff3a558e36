"""Distances between object points: scale bars give a free network its scale, and check it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, Story, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tests.close_range import CloseRange, close_range, with_scale_bars, write_project
from tests.flows.adjustment_alone import adjustment_alone

SIGMA_M = 2e-5


@pytest.fixture(scope="module")
def delivered(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, CloseRange]:
    """24 images of a test field with 9 scale bars, no start values at all, and the results."""
    folder = tmp_path_factory.mktemp("bars")
    generator = np.random.default_rng(7)
    truth = close_range(24, 60, 0.3, generator)
    write_project(folder, truth, 3e-6, generator)
    with_scale_bars(folder, truth, 9, SIGMA_M, generator)
    assert run(folder / "project.toml", story=aerial_triangulation).error is None
    return folder, truth


@pytest.fixture(scope="module")
def outcome(delivered: tuple[Path, CloseRange]) -> RunOutcome:
    """The same run, of which everything is there."""
    return run(delivered[0] / "project.toml", story=aerial_triangulation)


def size_of(x: np.ndarray) -> float:
    """Root mean square distance from the middle."""
    return float(np.sqrt(np.mean(np.sum((x - x.mean(axis=0)) ** 2, axis=1))))


def test_scale_bars_give_the_scale(delivered: tuple[Path, CloseRange], outcome: RunOutcome) -> None:
    points = pd.read_parquet(outcome.directory / "object_points.parquet").set_index("point")
    found = points.loc[delivered[1].targets, ["x_m", "y_m", "z_m"]].to_numpy()
    # Six bars of about 1 m, known to 20 µm each, with the noise of the images: some 10⁻⁵ of the scale.
    assert size_of(found) / size_of(delivered[1].target) == pytest.approx(1.0, abs=3e-5)
    assert outcome.summary.sigma0 == pytest.approx(1.0, abs=0.05)


def test_a_bar_that_took_part_and_a_check_bar_are_within_their_sigma(outcome: RunOutcome) -> None:
    table = pd.read_parquet(outcome.directory / "distance_residuals.parquet")
    assert dict(table["status"].value_counts()) == {"used": 6, "check": 3}
    ratio = table["difference_m"] / table["sigma_difference_m"]
    assert ratio.abs().max() < 3.5
    of_check = table[table["status"] == "check"]
    assert (of_check["sigma_difference_m"] > SIGMA_M).all()
    summary = json.loads((outcome.directory / "summary.json").read_text())["distances"]
    assert (summary["used"], summary["check"], summary["rejected"]) == (6, 3, 0)
    assert summary["over_limit"] < 1.0
    assert "distances" in (outcome.directory / "report.html").read_text()


def test_the_datum_of_the_free_network_lacks_the_scale_no_more(outcome: RunOutcome) -> None:
    summary = json.loads((outcome.directory / "summary.json").read_text())
    assert summary["free_network"]["defect"] == 6
    assert summary["groups"][1]["group"] == "distances"
    assert 0.0 < summary["groups"][1]["redundancy"] < 6.0
    assert {item["direction"] for item in summary["datum"] if item["sigma"] is not None} == {"scale"}
    report = (outcome.directory / "report.html").read_text()
    rows = report.split('data-key="rotation about x"')
    assert any(row.split("</tr>")[0].count("<td>not determined</td>") == 1 for row in rows[1:])


def changed(folder: Path, target: Path, change: object) -> Path:
    """A copy with other distances; what does not depend on them is not computed again."""
    shutil.copytree(folder, target)
    table = pd.read_csv(folder / "distances.csv", dtype={"point": str, "other_point": str})
    change(table)  # type: ignore[operator]
    table.to_csv(target / "distances.csv", index=False)
    return target / "project.toml"


def run(project: Path, *overrides: str, story: Story = adjustment_alone) -> RunOutcome:
    return carry_out(story, RunRequest(project, overrides=overrides))


def test_a_check_bar_that_is_wrong_takes_good_away(
    delivered: tuple[Path, CloseRange], tmp_path: Path
) -> None:
    def longer(table: pd.DataFrame) -> None:
        table.loc[2, "distance"] += 0.5

    found = run(changed(delivered[0], tmp_path / "p", longer), story=aerial_triangulation)
    assert found.summary.missed_checks == "check distances"
    assert any("Check distances are beyond their limits" in text for text in found.summary.problems)
    assert "the check distances are beyond their limits" in (found.directory / "report.html").read_text()


def test_a_bar_that_is_wrong_is_rejected(delivered: tuple[Path, CloseRange], tmp_path: Path) -> None:
    def longer(table: pd.DataFrame) -> None:
        table.loc[0, "distance"] += 0.5

    rejection = "adjustment.rejection={critical_value=4.13}"
    found = run(changed(delivered[0], tmp_path / "p", longer), rejection, story=aerial_triangulation)
    assert found.summary.distances is not None
    assert found.summary.distances.rejected == 1
    assert any("Distances were rejected as gross errors" in text for text in found.summary.problems)
    assert "Rejected: " in (found.directory / "report.html").read_text()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.__setitem__("distance", -t["distance"]), "is not positive"),
        (lambda t: t.__setitem__("other_point", t["point"]), "is from a point to itself"),
        (lambda t: t.__setitem__("role", "chek"), "The role 'chek' does not exist"),
        (lambda t: t.loc[1, ["point", "other_point"]].pipe(lambda _: _swap(t)), "already given in line 2"),
    ],
)
def test_impossible_distances_are_refused_with_their_line(
    delivered: tuple[Path, CloseRange], tmp_path: Path, change: object, said: str
) -> None:
    error = str(run(changed(delivered[0], tmp_path / "p", change)).error)
    assert said in error
    assert "distances.csv:" in error


def _swap(table: pd.DataFrame) -> None:
    """The second distance is the first one, the other way round."""
    table.loc[1, ["point", "other_point"]] = table.loc[0, ["other_point", "point"]].to_numpy()


def test_a_wrong_unit_is_refused_where_control_gives_the_scale(
    delivered: tuple[Path, CloseRange], tmp_path: Path
) -> None:
    generator = np.random.default_rng(7)
    truth = close_range(24, 60, 0.3, generator)
    write_project(tmp_path, truth, 3e-6, generator)
    (tmp_path / "distances.csv").write_text((delivered[0] / "distances.csv").read_text())
    project = tmp_path / "project.toml"
    bar = '[inputs.distances]\nfile = "distances.csv"\nunit = "UNIT"\nsigma = 0.02\n[adjustment]'
    text = project.read_text()
    project.write_text(text.replace("[adjustment]", bar.replace("UNIT", "m")))
    assert "times those between the object points" in str(run(project).error)
    project.write_text(text.replace("[adjustment]", bar.replace("UNIT", "mm")))
    found = run(project)
    assert found.error is None, found.error
    assert found.summary.distances is not None
    assert found.summary.distances.used == 6
