"""Whether one-step and two-step calibration give the same mounting and shift.

Both come from the same images, so their errors are positively correlated and the variance of their difference
is smaller than the sum of their variances. The test with the sum is therefore conservative: a contradiction
it reports is real. The standard deviations of the second step come from the scatter of few strips: they
count with Student's quantile over the normal one.

The one-step calibration has one mounting for all its images. Where the second step finds several, it is
compared with that of most of these images, and the existence of several is reported.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence

import numpy as np
import pandas as pd
from scipy import special

from adjust.arrays import Floats
from adjust.calibration.mean_variance import widening
from tasks.quantities import COMPONENTS, kind_of, named
from tasks.results.calibration_figures import ComparedStepFigure, StepComparisonFigure
from tasks.tables.covariance import Key, correlation_pairs, covariance_of, sigmas_of

# Kinds that the second step finds, by their axes in words.
_FOUND = ("boresight", "lever_arm", "gnss_shift")
#: Probability below which the two contradict each other.
CONTRADICTION = 0.01
# A verdict is given at 0.1 %, two-sided: so far Student's tails are to hold.
_LEVEL = 1.0 - 0.5 * 0.001


def comparison(compared: Sequence[ComparedStepFigure], chi_squared: float) -> StepComparisonFigure:
    """The test of all differences together.

    Parameters
    ----------
    chi_squared : dᵀ C⁻¹ d with the sum of both covariance matrices.
    """
    probability = float(special.chdtrc(len(compared), chi_squared))
    largest = max(compared, key=lambda item: abs(item.t))
    agree = "agree" if probability >= CONTRADICTION else "contradict each other"
    said = (
        f"One-step and two-step calibration {agree}: χ² = {chi_squared:.1f} of {len(compared)} "
        f"differences (probability {probability:.2g}); largest: {named(largest.parameter, largest.entity)}, "
        f"{abs(largest.t):.1f} σ."
    )
    return StepComparisonFigure(
        parameters=tuple(compared),
        chi_squared=chi_squared,
        freedom=len(compared),
        probability=probability,
        sentence=said,
    )


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
) -> StepComparisonFigure | None:
    """Compare what both have estimated; None if there is nothing to compare.

    Parameters
    ----------
    parameters, correlations : of the one-step calibration.
    means : orientation_difference_means.parquet of the second step.
    mountings : see `images_of_mountings`; None: all images have the main one.
    """
    of_cameras = mountings or {}
    means = _of_own_mounting(means, of_cameras)
    estimated = parameters[parameters["sigma"].notna() & parameters["parameter"].map(kind_of).isin(_FOUND)]
    found = [
        item for row in estimated.to_dict("records") if (item := _compared(row, means, estimated)) is not None
    ]
    if not found:
        return None
    keys: list[Key] = [(item.parameter, item.entity) for item, _ in found]
    covariance = covariance_of(keys, sigmas_of(parameters), correlation_pairs(correlations))
    covariance += np.diag([sigma**2 for _, sigma in found])
    difference: Floats = np.array([item.difference for item, _ in found])
    chi_squared = float(difference @ np.linalg.solve(covariance, difference))
    return comparison([item for item, _ in found], chi_squared)


def several_mountings(mountings: Mapping[str, Mapping[int, int]]) -> tuple[str, ...]:
    """A sentence for each camera whose images (see `images_of_mountings`) do not have one mounting."""
    return tuple(_not_one(camera, own) for camera, own in mountings.items() if len(own) > 1)


def _of_own_mounting(means: pd.DataFrame, mountings: Mapping[str, Mapping[int, int]]) -> pd.DataFrame:
    """The means for the mounting that most images of each camera have."""
    own = {camera: max(images, key=lambda number: images[number]) for camera, images in mountings.items()}
    wanted = means["camera"].map(lambda camera: str(own.get(camera, 0)))
    return means[(means["scope"] != "mounting") | (means["group"] == wanted)]


def _not_one(camera: str, images: Mapping[int, int]) -> str:
    number = max(images, key=lambda one: images[one])
    return (
        f"Camera {camera} was not flown with one mounting throughout, but the one-step calibration assumes "
        f"one. It is compared with mounting {number} ({images[number]:,} of {sum(images.values()):,} images)."
    )


def _compared(
    row: Mapping[Hashable, object], means: pd.DataFrame, estimated: pd.DataFrame
) -> tuple[ComparedStepFigure, float] | None:
    """The same quantity in both, and the σ of the second step by which normal limits hold.

    None if the second step does not determine it.
    """
    name, entity = str(row["parameter"]), str(row["entity"])
    kind, direction = COMPONENTS[name].kind.name, COMPONENTS[name].direction
    own = means[means["component"] == direction]
    if kind == "gnss_shift":
        flights = estimated.loc[estimated["parameter"] == name, "entity"]
        several = flights.nunique() > 1
        by_flight = (own["scope"] == "flight") & (own["group"] == entity)
        own = own[by_flight if several else own["scope"] == "mounting"]
    else:
        own = own[(own["camera"] == entity) & (own["scope"] == "mounting")]
    # With a lever arm and a shift free at once, the second step sees their sum.
    other = {"gnss_shift": "lever_arm", "lever_arm": "gnss_shift"}.get(kind)
    mixed = (estimated["parameter"].map(kind_of) == other).any()
    if len(own) != 1 or mixed or not np.isfinite(float(own["sigma"].iloc[0])):
        return None
    one, one_sigma = float(str(row["value"])), float(str(row["sigma"]))
    two, two_sigma = float(own["value"].iloc[0]), float(own["sigma"].iloc[0])
    widened = float(widening(float(own["freedom"].iloc[0]), _LEVEL)) * two_sigma
    figure = ComparedStepFigure(
        parameter=name,
        entity=entity,
        unit=str(row["unit"]),
        one_step=one,
        one_step_sigma=one_sigma,
        two_step=two,
        two_step_sigma=two_sigma,
        difference=one - two,
        t=(one - two) / float(np.hypot(one_sigma, widened)),
    )
    return figure, widened
