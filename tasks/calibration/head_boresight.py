"""Boresight of the heads of a rig: that of the reference head and their relative rotation together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.geometry import rotation
from tasks.tables.covariance import Key, correlation_pairs, covariance_of, sigmas_of

_AXES = ("roll", "pitch", "yaw")
#: What heads have from their reference head; it is no parameter of their own.
OF_REFERENCE = ("boresight", "lever_arm")


@dataclass(frozen=True, eq=False)
class HeadBoresight:
    """Mounting of a head against the inertial unit.

    Attributes
    ----------
    reference : name of the reference head.
    angles, sigma : (3,) roll, pitch, yaw, degrees; what is held has no error.
    """

    reference: str
    angles: Floats
    sigma: Floats

    def sentence(self, head: str) -> str:
        """For the record of the rig; `head` is the name of the head."""
        parts = ", ".join(
            f"{axis} {angle:.5f}° ± {sigma:.5f}°"
            for axis, angle, sigma in zip(_AXES, self.angles, self.sigma, strict=True)
        )
        return (
            f"Boresight and lever arm are those of {self.reference}; with the relative rotation the "
            f"boresight of {head} is {parts}."
        )


def head_boresights(
    parameters: pd.DataFrame, correlations: pd.DataFrame, cameras: pd.DataFrame
) -> Mapping[str, HeadBoresight]:
    """R_B(b) R(ρ) of every head that is not the reference head, by its name.

    A small rotation of it in body axes is E(b) db + R_B(b) E(ρ) dρ.

    Parameters
    ----------
    parameters, correlations, cameras : the tables of these names.
    """
    values = parameters.set_index(["parameter", "entity"])["value"]
    sigmas, pairs = sigmas_of(parameters), correlation_pairs(correlations)
    found = {}
    for head, reference in cameras.loc[cameras["head_of"].notna(), ["camera", "head_of"]].itertuples(
        index=False
    ):
        keys: list[Key] = [
            *((f"boresight_{axis}", reference) for axis in _AXES),
            *((f"relative_rotation_{axis}", head) for axis in _AXES),
        ]
        if not all(key in values.index for key in keys):
            # A head that took none of the images.
            continue
        b, rho = np.deg2rad(np.array([values[key] for key in keys])).reshape(2, 3)
        body = rotation.from_roll_pitch_yaw(b)
        angles = rotation.to_heading_pitch_roll(body @ rotation.from_roll_pitch_yaw(rho))[::-1]
        of_both = np.hstack(
            [rotation.roll_pitch_yaw_jacobian(b), body @ rotation.roll_pitch_yaw_jacobian(rho)]
        )
        of_both = np.asarray(np.linalg.inv(rotation.roll_pitch_yaw_jacobian(angles)) @ of_both)
        free = [number for number, key in enumerate(keys) if key in sigmas]
        covariance = covariance_of([keys[number] for number in free], sigmas, pairs)
        spread = of_both[:, free] @ covariance @ of_both[:, free].T
        found[str(head)] = HeadBoresight(str(reference), np.rad2deg(angles), np.sqrt(np.diagonal(spread)))
    return found
