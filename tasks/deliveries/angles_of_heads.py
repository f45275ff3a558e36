"""Orientations that another adjustment found are those of each image: of a head they lead to its body.

Other angles are of the body, the same for all heads (`docs/rigs.md`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow as pa

from adjust.arrays import Floats
from adjust.geometry import rotation
from tasks.deliveries.cameras import frame_cameras
from tasks.formats.meanings import ADJUSTED
from tasks.formats.records import ExposureRecords
from tasks.settings.inputs import ExposuresInput

_TO_RADIANS = {"deg": np.pi / 180.0, "gon": np.pi / 200.0, "rad": 1.0}
_RELATIVE = [f"relative_rotation_{name}_deg" for name in ("roll", "pitch", "yaw")]


def body_from_heads(cameras: pd.DataFrame) -> dict[str, Floats]:
    """Tᵀ R(ρ)ᵀ T (3, 3) of every head by its name: an image of it, turned so, has the angles of the body.

    Parameters
    ----------
    cameras : the table ``cameras``.
    """
    heads = cameras[cameras["head_of"].notna()]
    if heads.empty:
        return {}
    relative = rotation.from_roll_pitch_yaw(np.deg2rad(heads[_RELATIVE].to_numpy(np.float64)))
    return {
        name: camera.body_from_camera.T @ turn.T @ camera.body_from_camera
        for (name, camera), turn in zip(frame_cameras(heads).items(), relative, strict=True)
    }


def of_the_body(
    records: ExposureRecords, source: ExposuresInput, camera: pa.Array, heads: Mapping[str, Floats]
) -> ExposureRecords:
    """The same exposures; ω, φ, κ of images of heads are those of the body, with the declared rotation_deg.

    Parameters
    ----------
    camera : (n,) names of the cameras.
    heads : of `body_from_heads`.
    """
    order = source.angles.order
    if source.format not in ADJUSTED or order == "heading-pitch-roll" or not heads:
        return _said(records, heads)
    unit = _TO_RADIANS[source.angles.unit]
    read, written = (
        (rotation.from_omega_phi_kappa, rotation.to_omega_phi_kappa)
        if order == "omega-phi-kappa"
        else (rotation.from_phi_omega_kappa, rotation.to_phi_omega_kappa)
    )
    angles, names = records.angles.copy(), np.array(camera.to_pylist(), dtype=object)
    for head, turn in heads.items():
        rows = (names == head) & np.isfinite(angles).all(axis=1)
        angles[rows] = written(read(angles[rows] * unit) @ turn) / unit
    return _said(replace(records, angles=angles), heads)


def _said(records: ExposureRecords, heads: Mapping[str, Floats]) -> ExposureRecords:
    """With a remark where heads of the file are cameras alone in the project."""
    alone = [name for name, one in records.heads.items() if not {name, one.reference} & set(heads)]
    if not alone:
        return records
    remark = (
        f"{records.file.name} has rigs, but {', '.join(alone)} are single cameras in the project. "
        "`aerocal init` writes their tables [cameras.NAME.head]."
    )
    return replace(records, remarks=(*records.remarks, remark))
