"""The stage of the two-step calibration on a small delivery: weights, refusals, determinism."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tasks.errors import InputError
from tasks.stages.ingest import project_frame
from tasks.stages.two_step import calibrate_in_two_steps
from tasks.store.artifact import Artifact, artifact_of
from tasks.store.notes import read_notes
from tasks.tables.parquet import read_table, write_table
from tasks.tables.schemas.adjustment import EXTERIOR_ORIENTATIONS

COLUMNS = [column.name for column in EXTERIOR_ORIENTATIONS.columns if not column.nullable]


def orientations(delivery, folder: Path, shift_m: float = 0.5, **changes: object) -> Artifact:
    """Adjusted orientations: those of the delivery, shifted to the west."""
    table = delivery.table(delivery.exposures(), "exposures").assign(**changes)
    table["x_m"] -= shift_m
    sigmas = {name: 0.01 for name in COLUMNS if name.startswith("sigma_")}
    table = table.assign(**sigmas)[COLUMNS]
    file = folder / "exterior_orientations.parquet"
    write_table(file, EXTERIOR_ORIENTATIONS, {n: table[n].to_numpy() for n in COLUMNS}, frame(delivery))
    return artifact_of(file)


def frame(delivery):
    return project_frame(delivery.project().project)


def calibrate(delivery, adjusted: Artifact):
    read, project = delivery.exposures(), delivery.project()
    return calibrate_in_two_steps(
        delivery.store,
        exposures=read["exposures"],
        adjusted=adjusted,
        cameras=read["cameras"],
        project=project.project,
        mounting=project.calibration.mounting,
        limits=project.calibration.limits,
        strip_bias_m=project.adjustment.priors.gnss_strip_bias_m,
    )


def test_a_shift_to_the_east_comes_out_as_such(delivery, tmp_path: Path) -> None:
    outputs = calibrate(delivery, orientations(delivery, tmp_path))
    images = read_table(outputs["orientation_differences"])
    # The scale of UTM on its central meridian is 0.9996.
    np.testing.assert_allclose(images["east_m"], 0.5 / 0.9996, atol=2e-4)
    np.testing.assert_allclose(images[["north_m", "up_m"]], 0.0, atol=2e-4)
    # Half a metre along the earth turns the vertical, to which the angles refer, by 4.5e-6°.
    np.testing.assert_allclose(images[["roll_deg", "pitch_deg", "yaw_deg"]], 0.0, atol=5e-6)
    np.testing.assert_allclose(images["heading_deg"], [80.0, 79.0, 260.0], atol=0.1)
    means = read_table(outputs["orientation_difference_means"])
    assert set(means["scope"]) == {"all", "mounting", "flight", "heading", "height", "strip"}
    assert means["outlying"].isna().all()


def test_too_few_strips_are_said(delivery, tmp_path: Path) -> None:
    notes = read_notes(calibrate(delivery, orientations(delivery, tmp_path))["notes"])
    assert any("2 strips are too few" in text for text in notes.problems)


def test_an_image_with_a_large_standard_deviation_hardly_counts(delivery, tmp_path: Path) -> None:
    adjusted = orientations(delivery, tmp_path, shift_m=0.0)
    rows = delivery.texts["exposures"].splitlines()
    rows[0] += ",sx,sy,sz"
    rows[1] = rows[1].replace("500000", "500000.03") + ",90,90,90"
    rows[2:] = [row + ",0.05,0.05,0.05" for row in rows[2:]]
    delivery.write(exposures="\n".join(rows) + "\n")
    means = read_table(calibrate(delivery, adjusted)["orientation_difference_means"])
    (east,) = means[(means["scope"] == "all") & (means["component"] == "east")].itertuples()
    assert east.value_plain == pytest.approx(0.01, abs=1e-5)
    assert abs(east.value) < 1e-4


def test_a_shift_in_height_is_not_taken_for_the_wrong_sign_of_a_lever_arm(delivery, tmp_path: Path) -> None:
    """A metre up in every strip: with these two nothing tells a shift from a lever arm."""
    delivery.change("project", "mount_deg = 0\n", "mount_deg = 0\nlever_arm_m = [0.0, 0.0, 1.0]\n")
    height = delivery.table(delivery.exposures(), "exposures")["z_m"] - 1.0
    outputs = calibrate(delivery, orientations(delivery, tmp_path, shift_m=0.0, z_m=height))
    assert read_table(outputs["orientation_differences"])["down_m"].to_numpy() == pytest.approx(
        -1.0, abs=0.01
    )
    assert not any("wrong sign" in text for text in read_notes(outputs["notes"]).problems)


def test_no_common_image_is_refused(delivery, tmp_path: Path) -> None:
    names = np.array(["X1", "X2", "X3"], dtype=object)
    with pytest.raises(InputError, match="No image has both") as caught:
        calibrate(delivery, orientations(delivery, tmp_path, image=names))
    assert "use the same image names" in str(caught.value)


def test_external_orientations_of_antennas_are_refused(delivery) -> None:
    """The small delivery declares antenna positions: no adjustment gives those."""
    with pytest.raises(InputError, match="3 adjusted orientations are not given as projection centres"):
        calibrate(delivery, delivery.exposures()["exposures"])


def test_images_without_partner_are_counted(delivery, tmp_path: Path) -> None:
    adjusted = orientations(delivery, tmp_path, image=np.array(["I1", "I2", "new"], dtype=object))
    outputs = calibrate(delivery, adjusted)
    assert any(text.startswith("1 images have an adjusted") for text in read_notes(outputs["notes"]).problems)
    assert list(read_table(outputs["orientation_differences"])["image"]) == ["I1", "I2"]


def test_the_table_of_means_reads_back_by_its_key(delivery, tmp_path: Path) -> None:
    means = read_table(calibrate(delivery, orientations(delivery, tmp_path))["orientation_difference_means"])
    key = ["camera", "scope", "group", "component"]
    assert not means.duplicated(key).any()
    pd.testing.assert_frame_equal(means, means.sort_values(key).reset_index(drop=True))
