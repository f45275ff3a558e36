"""Blocks that lack something: adjusted and right, or refused with the reason."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tasks.simulation.truth_comparison import compare_with_truth
from tests.command_line import aerocal
from tests.flows.adjustment_alone import adjustment_alone

ANGLES = ["heading", "pitch", "roll"]


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """28 images in crossing strips, 84 control points."""
    folder = tmp_path_factory.mktemp("flight")
    simulate_project(load_simulation("uce-high", ("points.count=450",)), folder)
    return folder


@pytest.fixture
def delivered(flight: Path, tmp_path: Path) -> Path:
    """A copy of the delivery, to be changed."""
    return Path(shutil.copytree(flight, tmp_path / "project"))


def run(project: Path, *overrides: str) -> RunOutcome:
    return carry_out(adjustment_alone, RunRequest(project / "project.toml", overrides=overrides))


def change(path: Path, edit: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    edit(pd.read_csv(path, dtype=str, keep_default_na=False)).to_csv(path, index=False)


def keep_images(project: Path, *images: str) -> None:
    for name in ("exposures", "image_points"):
        change(project / f"{name}.csv", lambda table: table[table["image"].isin(images)])


def assert_true(project: Path, outcome: RunOutcome) -> None:
    assert outcome.error is None, outcome.error
    assert compare_with_truth(project, outcome.directory).contradictions() == ()


@pytest.mark.parametrize(
    "overrides",
    [
        ('adjustment.observe=["gnss","control"]', 'adjustment.free=["gnss_shift"]'),
        # Also tests/flows/test_unoriented_images.py, where positions are not even delivered.
        pytest.param(
            ('adjustment.observe=["ins","control"]', 'adjustment.free=["boresight"]'), marks=pytest.mark.slow
        ),
        ('adjustment.observe=["control"]', "adjustment.free=[]"),
    ],
    ids=["without INS", "without GNSS", "control only"],
)
def test_control_carries_a_block_without_gnss_or_ins(delivered: Path, overrides: tuple[str, ...]) -> None:
    assert_true(delivered, run(delivered, *overrides))


def test_attitudes_that_were_never_delivered(delivered: Path) -> None:
    """Half the strips are flown against the order of their names, and there are no times."""

    def without_angles(table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(**dict.fromkeys(ANGLES, "")).drop(columns="time")

    change(delivered / "exposures.csv", without_angles)
    outcome = run(delivered, 'adjustment.free=["gnss_shift"]')
    assert_true(delivered, outcome)
    assert any("28 exposures have no attitude" in text for text in outcome.summary.problems)


def test_an_image_without_attitude_alone_in_its_strip_is_oriented_by_its_points(
    delivered: Path,
) -> None:
    def lonely(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[0, [*ANGLES, "strip"]] = ["", "", "", "alone"]
        return table

    change(delivered / "exposures.csv", lonely)
    outcome = run(delivered)
    assert_true(delivered, outcome)
    assert any("1 images were oriented by their image points" in text for text in outcome.summary.problems)
    assert outcome.summary.counts.images == 28


def test_height_control_with_gnss_is_enough(delivered: Path) -> None:
    change(delivered / "control.csv", lambda table: table.assign(x="", y=""))
    # In height only: the shift in plan stays with GNSS, so it is held.
    outcome = run(delivered, 'adjustment.free=["boresight"]')
    assert outcome.error is None
    assert outcome.summary.counts.control == 84


def test_height_control_alone_leaves_the_plan_undetermined(delivered: Path) -> None:
    change(delivered / "control.csv", lambda table: table.assign(x="", y=""))
    outcome = run(delivered, 'adjustment.observe=["control"]', "adjustment.free=[]")
    assert outcome.summary.status == "not_computable"
    for direction in ("shift in x", "shift in y", "rotation about z"):
        assert direction in str(outcome.error)


def test_nothing_fixes_a_block_of_image_points_alone(delivered: Path) -> None:
    outcome = run(delivered, "adjustment.observe=[]", "adjustment.free=[]")
    assert outcome.summary.status == "not_computable"
    assert "rank defect of 7" in str(outcome.error)


def test_what_the_files_show_is_said_where_the_adjustment_cannot_be_computed(delivered: Path) -> None:
    """Control points that are called otherwise in the image points fix nothing."""
    change(delivered / "control.csv", lambda table: table.assign(point="P" + table["point"]))
    done = aerocal("adjust", delivered / "project.toml")
    assert done.returncode == 3
    assert "gnss_shift_x" in done.stderr
    unused = "84 of 84 control and check points are not measured in any image"
    assert f"Remark: {unused}" in done.stderr
    first, *others = json.loads((delivered / "results/summary.json").read_text())["problems"]
    assert "rank defect" in first
    assert any(unused in sentence for sentence in others)


def test_boresight_without_ins_is_refused_by_name(delivered: Path) -> None:
    outcome = run(delivered, 'adjustment.observe=["gnss","control"]', 'adjustment.free=["boresight"]')
    assert outcome.summary.status == "not_computable"
    assert "No observation depends on boresight_roll of UCE-80." in str(outcome.error)


def test_a_second_camera_that_took_no_image_does_not_disturb(delivered: Path) -> None:
    text = (delivered / "project.toml").read_text()
    start = text.index("[cameras.")
    end = text.index("[inputs.", start)
    spare = text[start:end].replace("UCE-80", "spare")
    (delivered / "project.toml").write_text(text[:end].rstrip("[") + spare + text[end:])
    assert_true(delivered, run(delivered))


def test_mean_residuals_of_one_image_indicate_no_correction(delivered: Path) -> None:
    keep_images(delivered, "E01_002")
    outcome = run(delivered, "adjustment.residual_grid.iterations=3")
    assert outcome.error is None, outcome.error
    assert any("chance alone explains the mean residuals" in text for text in outcome.summary.problems)


@pytest.mark.parametrize(
    "images", [("E01_002",), ("E01_001", "N02_004")], ids=["one image", "no common point"]
)
def test_a_free_network_without_a_point_in_two_images_is_refused(
    delivered: Path, images: tuple[str, ...]
) -> None:
    keep_images(delivered, *images)
    outcome = run(delivered, "adjustment.datum=free_network", "adjustment.observe=[]", "adjustment.free=[]")
    assert outcome.summary.status == "not_computable"
    assert "no object point is measured in two images" in str(outcome.error)


def test_two_cameras_have_a_boresight_each(delivered: Path) -> None:
    text = (delivered / "project.toml").read_text()
    start = text.index("[cameras.")
    end = text.index("[inputs.", start)
    (delivered / "project.toml").write_text(
        text[:end] + text[start:end].replace("UCE-80", "second") + text[end:]
    )

    def share_out(table: pd.DataFrame) -> pd.DataFrame:
        strips = sorted(table["strip"].unique())
        table.loc[table["strip"].isin(strips[::2]), "camera"] = "second"
        return table

    change(delivered / "exposures.csv", share_out)
    outcome = run(delivered)
    assert outcome.error is None
    found = {(p.parameter, p.entity): p for p in outcome.summary.parameters or ()}
    for name in ("boresight_roll", "boresight_pitch", "boresight_yaw"):
        one, other = found[name, "UCE-80"], found[name, "second"]
        # The truth is the same camera twice.
        assert abs(one.value - other.value) < 4.0 * (one.sigma**2 + other.sigma**2) ** 0.5


def test_a_gap_leaves_two_parts_that_gnss_holds_together(delivered: Path) -> None:
    cut_in_two(delivered)
    assert_true(delivered, run(delivered))


def test_a_gap_leaves_a_part_without_control_undetermined(delivered: Path) -> None:
    kept = cut_in_two(delivered)

    def on_one_side(table: pd.DataFrame) -> pd.DataFrame:
        points = pd.read_csv(delivered / "image_points.csv", dtype=str)
        seen = set(points.loc[points["image"].isin(kept), "point"])
        return table[table["point"].isin(seen)]

    change(delivered / "control.csv", on_one_side)
    outcome = run(delivered, 'adjustment.observe=["control"]', "adjustment.free=[]")
    assert outcome.summary.status == "not_computable"
    assert "rank defect of 7" in str(outcome.error)


def cut_in_two(project: Path) -> set[str]:
    """Take away every point seen from both sides of the block's middle; the images of the western side."""
    exposures = pd.read_csv(project / "exposures.csv", dtype={"image": str})
    middle = exposures["x"].median()
    western = set(exposures.loc[exposures["x"] < middle, "image"])

    def without_ties_across(table: pd.DataFrame) -> pd.DataFrame:
        side = table["image"].isin(western)
        both = side.groupby(table["point"]).transform("nunique") > 1
        return table[~both]

    change(project / "image_points.csv", without_ties_across)
    return western
