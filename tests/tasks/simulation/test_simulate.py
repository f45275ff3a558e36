from __future__ import annotations

import hashlib
import re
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tasks.errors import InputError
from tasks.files.installation import InstallationError
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.tasks.forked import fails_with_files_of_at_most

SMALL = """
preset = "uce-high"
seed = 3
[points]
count = 120
"""


def _simulated(folder: Path, *overrides: str, text: str = SMALL) -> Path:
    spec = folder.parent / f"{folder.name}-spec.toml"
    spec.parent.mkdir(parents=True, exist_ok=True)
    spec.write_text(text, encoding="utf-8")
    return simulate_project(load_simulation(str(spec), overrides), folder).project_file


def _digests(folder: Path) -> dict[str, str]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def test_the_same_seed_writes_the_same_bytes_and_another_does_not(tmp_path: Path) -> None:
    _simulated(tmp_path / "a")
    _simulated(tmp_path / "b")
    _simulated(tmp_path / "c", "seed=4")
    one, same, other = (_digests(tmp_path / name) for name in "abc")
    assert one == same
    assert set(one) == set(other)
    assert one["image_points.csv"] != other["image_points.csv"]


def test_the_written_specification_writes_the_same_bytes_again(tmp_path: Path) -> None:
    _simulated(tmp_path / "a", "control.control=9", "noise.gross_errors.image_rate=0.01")
    spec = tmp_path / "a" / "truth" / "spec.toml"
    simulate_project(load_simulation(str(spec)), tmp_path / "b")
    assert _digests(tmp_path / "a") == _digests(tmp_path / "b")


def test_switching_the_noise_off_leaves_the_truth_as_it_was(tmp_path: Path) -> None:
    _simulated(tmp_path / "a")
    _simulated(tmp_path / "b", "noise.level=0")
    loud, silent = _digests(tmp_path / "a"), _digests(tmp_path / "b")
    assert loud["image_points.csv"] != silent["image_points.csv"]
    for name in loud:
        if name.startswith("truth/") and not name.endswith("spec.toml"):
            assert loud[name] == silent[name], name


def test_the_project_is_valid_and_states_what_was_simulated(tmp_path: Path) -> None:
    changes = (
        "truth.lever_arm_m=[0.3, 0.1, -1.0]",
        "truth.strip_bias_m=[0.03, 0.03, 0.04]",
        "truth.refraction=true",
        "noise.gnss_markov_m=[0.02, 0.02, 0.02]",
    )
    project = load_project(_simulated(tmp_path / "a", *changes))
    assert project.adjustment.free == ("boresight", "lever_arm", "gnss_shift", "gnss_strip_bias")
    assert project.adjustment.priors.gnss_strip_bias_m == (0.03, 0.03, 0.04)
    assert project.adjustment.refraction == "standard"
    assert project.adjustment.rejection.critical_value is None
    exposures = project.inputs.exposures[0]
    np.testing.assert_allclose(exposures.sigma.position_m, np.hypot(0.05, 0.02))
    assert project.inputs.image_points[0].sigma == pytest.approx((0.00105, 0.00105))
    assert project.cameras["UCE-80"].focal_length_mm == 80.0


def test_parameters_to_estimate_can_be_named(tmp_path: Path) -> None:
    project = load_project(_simulated(tmp_path / "a", 'project.free=["boresight"]'))
    assert project.adjustment.free == ("boresight",)


def test_surveyed_points_lack_what_is_not_known(tmp_path: Path) -> None:
    kinds = """
[[control]]
layout = "grid"
columns = 2
rows = 2
[[control]]
layout = "perimeter"
count = 3
kind = "height"
[[control]]
layout = "spread"
count = 2
kind = "plan"
check_fraction = 0.5
"""
    _simulated(tmp_path / "a", text=SMALL + kinds)
    table = pd.read_csv(tmp_path / "a" / "control.csv")
    known = table[["x", "y", "z"]].notna()
    assert (
        known.to_numpy().tolist() == [[True] * 3] * 4 + [[False, False, True]] * 3 + [[True, True, False]] * 2
    )
    assert table["role"].tolist().count("check") == 1
    truth = pd.read_parquet(tmp_path / "a" / "truth" / "control_points.parquet")
    assert truth["known"].tolist() == ["xyz"] * 4 + ["z"] * 3 + ["xy"] * 2
    assert truth[["x_m", "y_m", "z_m"]].notna().to_numpy().all()


def test_a_block_without_control_declares_none(tmp_path: Path) -> None:
    text = SMALL.replace("seed = 3\n", "seed = 3\ncontrol = []\n")
    project = load_project(_simulated(tmp_path / "a", text=text))
    assert project.inputs.control == ()
    assert not (tmp_path / "a" / "control.csv").exists()


def test_gross_errors_are_listed_where_they_were_put(tmp_path: Path) -> None:
    changes = (
        "noise.level=0",
        "noise.gross_errors.image_rate=0.02",
        "noise.gross_errors.control_swaps=2",
        "noise.gross_errors.wrong_time_strips=1",
    )
    _simulated(tmp_path / "right", "noise.level=0")
    project = load_project(_simulated(tmp_path / "wrong", *changes))
    assert project.adjustment.rejection.critical_value == 4.13
    listed = pd.read_parquet(tmp_path / "wrong" / "truth" / "gross_errors.parquet")

    right, wrong = (
        pd.read_csv(tmp_path / name / "image_points.csv", index_col=["image", "point"])
        for name in ("right", "wrong")
    )
    change = 1e3 * (wrong - right)
    moved = change[(change.abs() > 1e-6).any(axis=1)]
    of_images = listed[listed["kind"] == "image_point"].set_index(["image", "point"])
    assert len(of_images) > 3
    assert set(moved.index) == set(of_images.index)
    np.testing.assert_allclose(moved, of_images.loc[moved.index, ["dx_um", "dy_um"]], atol=1e-5)

    right, wrong = (pd.read_csv(tmp_path / n / "control.csv", index_col="point") for n in ("right", "wrong"))
    swaps = listed[listed["kind"] == "control_swap"]
    assert len(swaps) == 4
    columns = ["x", "y", "z"]
    np.testing.assert_array_equal(wrong.loc[swaps["point"], columns], right.loc[swaps["other"], columns])

    right, wrong = (
        pd.read_csv(tmp_path / n / "exposures.csv", index_col="image") for n in ("right", "wrong")
    )
    shift = np.linalg.norm(wrong[columns] - right[columns], axis=1)
    strip = listed.loc[listed["kind"] == "strip_time", "strip"].item()
    np.testing.assert_allclose(shift[wrong["strip"] == strip], 75.0, rtol=0.05)
    assert not shift[wrong["strip"] != strip].any()


def test_true_parameters_carry_the_names_and_units_of_the_results(tmp_path: Path) -> None:
    _simulated(tmp_path / "a", "truth.focal_length_change_mm=-0.008")
    table = pd.read_parquet(tmp_path / "a" / "truth" / "parameters.parquet").set_index("parameter")
    row = table.loc["focal_length"]
    assert (row["entity"], row["unit"]) == ("UCE-80", "mm")
    assert row["value"] == pytest.approx(79.992)
    assert row["stated"] == pytest.approx(80.0)
    assert table.loc["boresight_roll", "value"] == pytest.approx(0.00468)
    assert table.loc["gnss_shift_z", "value"] == pytest.approx(0.286)


def test_nothing_that_no_simulation_wrote_is_overwritten(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "project.toml").write_text("mine")
    with pytest.raises(InputError, match="no simulation wrote"):
        _simulated(folder)
    assert (folder / "project.toml").read_text() == "mine"
    again = tmp_path / "again"
    _simulated(again)
    _simulated(again, "seed=9")
    assert tomllib.loads((again / "truth" / "spec.toml").read_text())["seed"] == 9


def test_a_flight_that_covers_nothing_twice_is_refused(tmp_path: Path) -> None:
    text = 'preset = "uce-high"\n[[flight]]\nname = "A"\nheight_m = 500\nheading_deg = 0\nexposures = 1\n'
    with pytest.raises(InputError, match="No ground is seen by 2 images"):
        _simulated(tmp_path / "a", text=text)


def test_a_full_disk_is_one_sentence_about_the_installation(tmp_path: Path) -> None:
    _simulated(tmp_path / "a")
    points = tmp_path / "a" / "image_points.csv"
    points.unlink()
    points.symlink_to("/dev/full")
    with pytest.raises(InstallationError, match="no space left on the disk"):
        _simulated(tmp_path / "a")


def test_points_hardly_ever_found_are_refused_before_they_fill_the_memory(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="hardly one would be found"):
        _simulated(tmp_path / "a", "points.detection=1e-9")


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (("trajectory.sbet_hz=200.0",), "no location on the earth"),
        (("trajectory.sbet_hz=200.0", "trajectory.rate_deg_s=[1.0, 1.0, 1.0]"), "follow from its path"),
        (
            (
                "trajectory.sbet_hz=200.0",
                "project.crs=EPSG:25832",
                "project.latitude_deg=48.9",
                "project.longitude_deg=9.0",
                "project.angles=omega-phi-kappa",
            ),
            "heading, pitch, roll",
        ),
    ],
)
def test_a_trajectory_that_cannot_be_is_refused(tmp_path: Path, changes: tuple[str, ...], says: str) -> None:
    with pytest.raises(InputError, match=says):
        _simulated(tmp_path / "a", *changes)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ('camera.name="A,B"', "cannot contain the name 'A,B'"),
        ('camera.name=" "', "cannot contain the name ' '"),
        ("flight.0.flight='a\"b'", "cannot contain the name 'a\"b'"),
        ('film.fiducials_mm={"a,b"=[1, 2], 2=[3, 4], 3=[3, 5]}', "cannot contain the name 'a,b'"),
        ("noise.gross_errors.image_um=[200, 20]", "The minimum of image_um is 200 µm, and its maximum 20 µm"),
        ("noise.gross_errors.control_swaps=50", "control_swaps is 50, and only 42 are possible"),
        ("noise.gross_errors.wrong_time_strips=50", "wrong_time_strips is 50, and only 4 are possible"),
        ("truth.focal_length_change_mm=-100", "The true focal length of UCE-80 would be -20 mm"),
        ('truth.image_errors.additional_um={"brown:K1"=1e8}', "No point is measured in any image"),
        (
            'project={name="P", crs="EPSG:4326", latitude_deg=48, longitude_deg=9}',
            "The CRS EPSG:4326 is geographic, and results are in metres",
        ),
        (
            'project={name="P", crs="EPSG:32633", latitude_deg=89.5, longitude_deg=15}',
            "At latitude 89.5, longitude 15 degrees the block is outside the area of EPSG:32633",
        ),
    ],
)
def test_what_gives_no_project_is_refused_before_anything_is_written(
    tmp_path: Path, override: str, words: str
) -> None:
    with pytest.raises(InputError, match=re.escape(words)):
        _simulated(tmp_path / "block", override)
    assert not (tmp_path / "block").exists()


@pytest.mark.parametrize("there", [True, False])
def test_a_full_disk_leaves_nothing_in_a_new_folder(tmp_path: Path, there: bool) -> None:
    """What was left made the next simulation refuse the folder."""
    folder = tmp_path / "block"
    if there:
        folder.mkdir()
    # The truth fits, the image points do not.
    assert fails_with_files_of_at_most(20_000, lambda: _simulated(folder))
    assert list(folder.iterdir()) == []
    assert _simulated(folder).is_file()


def test_a_folder_of_a_simulation_that_was_killed_is_taken_again(tmp_path: Path) -> None:
    project = _simulated(tmp_path / "a")
    whole = _digests(project.parent)
    for name in ("project.toml", "exposures.csv", "truth/image_errors.parquet"):
        (project.parent / name).unlink()
    _simulated(tmp_path / "a")
    assert _digests(project.parent) == whole
    first = min((project.parent / "truth").iterdir(), key=lambda path: path.stat().st_mtime_ns)
    assert first.name == "spec.toml"
