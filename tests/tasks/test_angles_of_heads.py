"""Orientations of other adjustments lead from the images of heads to the body they sit on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from adjust.geometry import rotation
from tasks.deliveries.angles_of_heads import body_from_heads, of_the_body
from tasks.formats.plain_records import exposures_of
from tasks.formats.records import HeadRecord
from tasks.settings.inputs import Angles, ExposuresInput

MOUNTING = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
ROLL_PITCH_YAW = (40.0, -3.0, 5.0)
BODY = rotation.from_roll_pitch_yaw(np.radians([[178.0, 3.0, 40.0], [181.0, -2.0, -110.0]]))
WAYS = {
    "omega-phi-kappa": (rotation.from_omega_phi_kappa, rotation.to_omega_phi_kappa),
    "phi-omega-kappa": (rotation.from_phi_omega_kappa, rotation.to_phi_omega_kappa),
}


def cameras() -> pd.DataFrame:
    row = {
        "columns": 1000, "rows": 800, "pixel_um": 4.0, "focal_length_mm": 50.0, "principal_point_x_mm": 0.0,
        "principal_point_y_mm": 0.0, "pixel_origin": "corner", "mount_deg": 90, "head_of": None,
    }  # fmt: skip
    turn = {f"relative_rotation_{name}_deg": np.nan for name in ("roll", "pitch", "yaw")}
    head = dict(zip(turn, ROLL_PITCH_YAW, strict=True))
    return pd.DataFrame([{**row, **turn, "camera": "N"}, {**row, **head, "camera": "L", "head_of": "N"}])


@pytest.mark.parametrize(("order", "unit"), [("omega-phi-kappa", "deg"), ("phi-omega-kappa", "gon")])
def test_images_of_a_head_have_the_angles_of_the_body(order: str, unit: str) -> None:
    read, written = WAYS[order]
    scale = {"deg": np.pi / 180.0, "gon": np.pi / 200.0}[unit]
    of_head = rotation.from_roll_pitch_yaw(np.radians(ROLL_PITCH_YAW)) @ MOUNTING
    images = np.concatenate([BODY @ MOUNTING, BODY @ of_head])
    names = ["N", "N", "L", "L"]
    records = exposures_of(
        Path("f"), ["a", "b", "c", "d"], np.zeros((4, 3)), written(images) / scale, range(1, 5), camera=names
    )
    source = ExposuresInput.model_construct(
        format="bingo", angles=Angles.model_validate({"order": order, "unit": unit, "reference": "grid"})
    )
    heads = body_from_heads(cameras())
    assert set(heads) == {"L"}
    found = of_the_body(records, source, pa.array(names), heads)
    body = read(found.angles * scale) @ MOUNTING.T
    np.testing.assert_allclose(body, np.concatenate([BODY, BODY]), rtol=0, atol=1e-12)
    # Angles of a table are those of the body already.
    table = source.model_copy(update={"format": "csv"})
    assert of_the_body(records, table, pa.array(names), heads) is records


def test_heads_of_the_file_that_the_project_does_not_declare_are_told() -> None:
    records = exposures_of(Path("f.xml"), ["a"], np.zeros((1, 3)), np.zeros((1, 3)), [1], camera=["L"])
    records = replace(records, heads={"L": HeadRecord("N", np.eye(3), np.zeros(3))})
    source = ExposuresInput.model_construct(
        format="metashape", angles=Angles(order="omega-phi-kappa", unit="deg", reference="grid")
    )
    (remark,) = of_the_body(records, source, pa.array(["L"]), {}).remarks
    assert remark.startswith("f.xml has rigs, but L are single cameras in the project.")
    assert of_the_body(records, source, pa.array(["L"]), {"L": np.eye(3)}).remarks == ()
