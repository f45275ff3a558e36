"""Whether one-step and two-step calibration give the same mounting and shift.

Both come from the same images, so their errors are positively correlated and the variance of their difference
is smaller than the sum of their variances. The test with the sum is therefore a cautious one: what it calls a
contradiction is one. The standard deviations of the second step come from the scatter of few strips: they
count with Student's quantile over the normal one.

The one-step calibration has one mounting for all its images. Where the second step finds several, it is
compared with that of most of these images, and it is said that there is not one.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import special

from adjust.arrays import Floats
from adjust.calibration.mean_variance import widening
from tasks.storage.json_text import JSON
from tasks.tables.covariance import Key, correlation_pairs, covariance_of, sigmas_of

# Component of the two-step calibration of each parameter of the one-step calibration.
_COMPONENT = {
    "boresight_roll": "roll",
    "boresight_pitch": "pitch",
    "boresight_yaw": "yaw",
    "lever_arm_x": "forward",
    "lever_arm_y": "right",
    "lever_arm_z": "down",
    "gnss_shift_x": "east",
    "gnss_shift_y": "north",
    "gnss_shift_z": "up",
}
#: Probability below which the two contradict each other.
CONTRADICTION = 0.01
# A verdict is given at 0.1 %, two-sided: so far Student's tails are to hold.
_LEVEL = 1.0 - 0.5 * 0.001


@dataclass(frozen=True)
class ComparedParameter:
    """A parameter that both have estimated, in the unit of parameters.parquet.

    Attributes
    ----------
    two_step_widening : Student's quantile of the second step over the normal one.
    """

    parameter: str
    entity: str
    unit: str
    one_step: float
    one_step_sigma: float
    two_step: float
    two_step_sigma: float
    two_step_widening: float = 1.0

    @property
    def difference(self) -> float:
        """One-step minus two-step."""
        return self.one_step - self.two_step

    @property
    def t(self) -> float:
        """Difference over the root of the sum of both variances, the second widened."""
        return self.difference / float(np.hypot(self.one_step_sigma, self.widened_sigma))

    @property
    def widened_sigma(self) -> float:
        """σ of the second step by which limits of the normal distribution hold."""
        return self.two_step_widening * self.two_step_sigma

    def to_json(self) -> JSON:
        """For summary.json."""
        return {
            "parameter": self.parameter,
            "entity": self.entity,
            "unit": self.unit,
            "one_step": self.one_step,
            "one_step_sigma": self.one_step_sigma,
            "two_step": self.two_step,
            "two_step_sigma": self.two_step_sigma,
            "difference": self.difference,
            "t": self.t,
        }


@dataclass(frozen=True)
class StepComparison:
    """The test of all differences together.

    Attributes
    ----------
    chi_squared, freedom : dᵀ C⁻¹ d with the sum of both covariance matrices, and its degrees of freedom.
    probability : of a value as large by chance if the two are the same.
    mountings : a sentence for each camera whose images do not have one mounting.
    """

    parameters: tuple[ComparedParameter, ...]
    chi_squared: float
    freedom: int
    probability: float
    mountings: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """What it says, for people."""
        largest = max(self.parameters, key=lambda item: abs(item.t))
        agree = "agree" if self.probability >= CONTRADICTION else "contradict each other"
        compared = (
            f"One-step and two-step calibration {agree}: χ² = {self.chi_squared:.1f} of {self.freedom} "
            f"differences (probability {self.probability:.2g}); largest: {largest.parameter} of "
            f"{largest.entity}, {abs(largest.t):.1f} σ."
        )
        return " ".join((compared, *self.mountings))

    def to_json(self) -> JSON:
        """For summary.json."""
        return {
            "parameters": [item.to_json() for item in self.parameters],
            "chi_squared": self.chi_squared,
            "freedom": self.freedom,
            "probability": self.probability,
            "sentence": self.sentence,
        }


def images_of_mountings(differences: pd.DataFrame, images: pd.DataFrame) -> dict[str, dict[int, int]]:
    """Number of the images of a block with each mounting, by camera.

    Parameters
    ----------
    differences : orientation_differences.parquet of the second step.
    images : images.parquet of the one-step calibration.
    """
    own = differences[differences["image"].isin(images["image"])]
    counted: dict[str, dict[int, int]] = {}
    for camera, number in zip(own["camera"], own["mounting"], strict=True):
        of_camera = counted.setdefault(str(camera), {})
        of_camera[int(number)] = of_camera.get(int(number), 0) + 1
    return counted


def compared_steps(
    parameters: pd.DataFrame,
    correlations: pd.DataFrame,
    means: pd.DataFrame,
    mountings: Mapping[str, Mapping[int, int]] | None = None,
) -> StepComparison | None:
    """Compare what both have estimated; None if that is nothing.

    Parameters
    ----------
    parameters, correlations : of the one-step calibration.
    means : orientation_difference_means.parquet of the second step.
    mountings : see `images_of_mountings`; None: all images have the main one.
    """
    of_cameras = mountings or {}
    means = _of_own_mounting(means, of_cameras)
    estimated = parameters[parameters["sigma"].notna() & parameters["parameter"].isin(_COMPONENT)]
    found = [
        item for row in estimated.to_dict("records") if (item := _compared(row, means, estimated)) is not None
    ]
    if not found:
        return None
    keys: list[Key] = [(item.parameter, item.entity) for item in found]
    covariance = covariance_of(keys, sigmas_of(parameters), correlation_pairs(correlations))
    covariance += np.diag([item.widened_sigma**2 for item in found])
    difference: Floats = np.array([item.difference for item in found])
    chi_squared = float(difference @ np.linalg.solve(covariance, difference))
    probability = float(special.chdtrc(len(found), chi_squared))
    said = tuple(_not_one(camera, own) for camera, own in of_cameras.items() if len(own) > 1)
    return StepComparison(tuple(found), chi_squared, len(found), probability, said)


def _of_own_mounting(means: pd.DataFrame, mountings: Mapping[str, Mapping[int, int]]) -> pd.DataFrame:
    """Of the means of mountings those of the mounting that most images of each camera have."""
    own = {camera: max(images, key=lambda number: images[number]) for camera, images in mountings.items()}
    wanted = means["camera"].map(lambda camera: str(own.get(camera, 0)))
    return means[(means["scope"] != "mounting") | (means["group"] == wanted)]


def _not_one(camera: str, images: Mapping[int, int]) -> str:
    number = max(images, key=lambda one: images[one])
    return (
        f"Camera {camera} was not flown with one mounting, and the one-step calibration has one for all: it "
        f"is compared with mounting {number} ({images[number]:,} of {sum(images.values()):,} images)."
    )


def _compared(
    row: Mapping[Hashable, object], means: pd.DataFrame, estimated: pd.DataFrame
) -> ComparedParameter | None:
    """The same quantity in both; None if the second step says nothing about it."""
    name, entity = str(row["parameter"]), str(row["entity"])
    own = means[means["component"] == _COMPONENT[name]]
    if name.startswith("gnss_shift"):
        flights = estimated.loc[estimated["parameter"] == name, "entity"]
        several = flights.nunique() > 1
        by_flight = (own["scope"] == "flight") & (own["group"] == entity)
        own = own[by_flight if several else own["scope"] == "mounting"]
    else:
        own = own[(own["camera"] == entity) & (own["scope"] == "mounting")]
    # With a lever arm and a shift free at once, the second step sees their sum.
    other = "lever_arm" if name.startswith("gnss_shift") else "gnss_shift"
    mixed = not name.startswith("boresight") and estimated["parameter"].str.startswith(other).any()
    if len(own) != 1 or mixed or not np.isfinite(float(own["sigma"].iloc[0])):
        return None
    return ComparedParameter(
        name,
        entity,
        str(row["unit"]),
        float(str(row["value"])),
        float(str(row["sigma"])),
        float(own["value"].iloc[0]),
        float(own["sigma"].iloc[0]),
        float(widening(float(own["freedom"].iloc[0]), _LEVEL)),
    )
