"""Whether two calibrations of a camera agree within their standard deviations.

With values x and covariances C of the parameters that both have estimated, d = x₂ − x₁ of two independent
calibrations has the covariance C₁ + C₂, and dᵀ (C₁ + C₂)⁻¹ d is a χ² with as many degrees of freedom as there
are parameters. A single parameter has t = d/σ_d. What belongs to a flight or a strip (GNSS shift, bias, time
offset) is another quantity in every flight and is not compared; boresight and lever arm only if the mounting
is the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from adjust.arrays import Floats
from adjust.parameters import BORESIGHT, FAMILIES, LEVER_ARM
from tasks.calibration.record import CalibratedParameter, CalibrationRecord
from tasks.document_kit.table import Number, decimals_for
from tasks.quantities import entity_kind, entity_words, is_additional, quantity_words, shown, with_unit
from tasks.registry.identity import CameraBody, heads_of

if TYPE_CHECKING:
    from tasks.tables.covariance import Key

#: Probability with which two calibrations of an unchanged camera are called different.
ERROR_PROBABILITY = 0.01
# Directions of the difference that both calibrations together know so badly do not count.
_RANK = 1e-12
#: Parameters that apply to one mounting.
OF_MOUNTING = {name for family in (BORESIGHT, LEVER_ARM) for name in FAMILIES[family].components}


@dataclass(frozen=True)
class ParameterChange:
    """How one parameter differs.

    Attributes
    ----------
    parameter, unit : as in parameters.parquet.
    head : of a rig the name of the head; empty: the camera or reference head.
    change : new − old.
    sigma : of the change, from both calibrations.
    outstanding : whether it is larger than chance explains, in view of how many are checked.
    """

    parameter: str
    unit: str
    change: float
    sigma: float
    outstanding: bool
    head: str = ""

    @property
    def words(self) -> str:
        """What has changed: focal length, relative rotation roll of left."""
        return entity_words(self.parameter, self.head)

    @property
    def t(self) -> float:
        """The change in its σ."""
        return self.change / self.sigma

    @property
    def sentence(self) -> str:
        """Focal length changed by +4.1 µm, 3.2 σ."""
        unit, factor, _ = shown(self.unit, "change")
        change, sigma = self.change * factor, self.sigma * factor
        number = with_unit(Number(change, decimals_for(sigma), plus=True), unit)
        return f"{self.words} changed by {number}, {abs(self.t):.1f} σ"


@dataclass(frozen=True)
class Compatibility:
    """How a new calibration differs from an old one.

    Attributes
    ----------
    changes : of the parameters both have estimated, in the order of the new record.
    chi2 : of all of them together.
    degrees_of_freedom : how many directions of the difference are known.
    probability : of a χ² this large or larger, if nothing has changed.
    new_only, old_only : parameters that only one of them has estimated.
    same_mounting : whether boresight and lever arm could be compared.
    shared_inputs : how many files both were made from; then they are not independent.
    """

    changes: tuple[ParameterChange, ...]
    chi2: float
    degrees_of_freedom: int
    probability: float
    new_only: tuple[str, ...]
    old_only: tuple[str, ...]
    same_mounting: bool
    shared_inputs: int

    @property
    def agrees(self) -> bool:
        """Whether chance explains the difference."""
        return self.probability >= ERROR_PROBABILITY

    @property
    def sentences(self) -> tuple[str, ...]:
        """The result in words."""
        if not self.changes:
            nothing = "No parameter of the camera was estimated by both, so nothing was compared."
            return (nothing,)
        said = [self._of_all(), *(f"{_sentence(c)}." for c in self.changes if c.outstanding)]
        if not self.same_mounting:
            said.append("The mounting is different, so boresight and lever arm were not compared.")
        if self.shared_inputs:
            said.append(
                f"Both calibrations were made from {self.shared_inputs} common file(s). The test assumes "
                "that they are independent; calibrations of the same flight should differ by less."
            )
        if self.new_only or self.old_only:
            parts = [
                f"{', '.join(quantity_words(n) for n in names)} by the {which} one only"
                for which, names in (("new", self.new_only), ("old", self.old_only))
                if names
            ]
            said.append(f"Estimated {'; '.join(parts)}: not compared, but it may absorb part of the others.")
        return tuple(said)

    def _of_all(self) -> str:
        count = len(self.changes)
        what = f"All {count} common parameters" if count > 1 else "The one common parameter"
        figures = (
            f"χ² = {self.chi2:.1f} with {self.degrees_of_freedom} degree"
            f"{'s' if self.degrees_of_freedom != 1 else ''} of freedom, exceeded by chance in "
            f"{_percent(self.probability)} of all cases"
        )
        if self.agrees:
            return f"{what} together agree: {figures}."
        return (
            f"{what} together do not agree: {figures}. The camera has changed, or one of the "
            "calibrations has σ that are too small."
        )


def compatibility(new: CalibrationRecord, old: CalibrationRecord) -> Compatibility:
    """Compare two calibrations of one camera, whatever its name; heads are called as in the new one."""
    mounted = [CameraBody.of_calibration(record).mounting_key for record in (new, old)]
    same_mounting = mounted[0] == mounted[1]
    same_axes = new.camera.calibration_axes_deg == old.camera.calibration_axes_deg
    of_new, of_old = (
        _comparable(record, heads_of(record, new), same_mounting, same_axes) for record in (new, old)
    )
    common = [
        name for name, index in of_new.items()
        if name in of_old and new.estimated[index].unit == old.estimated[of_old[name]].unit
    ]  # fmt: skip
    i, j = [of_new[name] for name in common], [of_old[name] for name in common]
    change = np.array([new.estimated[a].value - old.estimated[b].value for a, b in zip(i, j, strict=True)])
    covariance = new.covariance_matrix[np.ix_(i, i)] + old.covariance_matrix[np.ix_(j, j)]
    chi2, rank = quadratic_form(change, covariance)
    # Not needed by those who only list calibrations; likewise below.
    from scipy import special

    return Compatibility(
        _changes(common, [new.estimated[a] for a in i], change, np.sqrt(np.diagonal(covariance))),
        chi2,
        rank,
        float(special.chdtrc(rank, chi2)) if rank else 1.0,
        tuple(dict.fromkeys(key[0] for key in of_new if key not in of_old)),
        tuple(dict.fromkeys(key[0] for key in of_old if key not in of_new)),
        same_mounting,
        len(set(new.inputs.values()) & set(old.inputs.values())),
    )


def quadratic_form(difference: Floats, covariance: Floats) -> tuple[float, int]:
    """dᵀ C⁺ d and the rank of C, of a difference (k,) with the covariance (k, k).

    Units as different as mm and 1/mm² must not decide about the rank, so it is that of the correlations.
    """
    if len(difference) == 0:
        return 0.0, 0
    sigma = np.sqrt(np.diagonal(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(sigma, sigma))
    known = values > _RANK * values[-1]
    projected = vectors.T[known] @ (difference / sigma)
    return float(np.sum(projected**2 / values[known])), int(known.sum())


def single_limit(count: int, probability: float = ERROR_PROBABILITY) -> float:
    """|t| that the largest of `count` parameters exceeds with a probability of error (Šidák 1967)."""
    from scipy import special

    each = 1.0 - (1.0 - probability) ** (1.0 / max(count, 1))
    return float(special.ndtri(1.0 - 0.5 * each))


def _comparable(
    record: CalibrationRecord, heads: Mapping[str, str], same_mounting: bool, same_axes: bool
) -> dict[Key, int]:
    """Parameter and head → place among the estimated ones, of those that are the camera's and determined."""
    return {
        (item.parameter, heads[item.entity]): index
        for index, item in enumerate(record.estimated)
        if item.entity in heads
        and entity_kind(item.parameter) == "camera"
        and item.verdict in ("determined", "weak")
        and item.sigma
        and (same_mounting or item.parameter not in OF_MOUNTING)
        # Additional parameters are functions of the calibration axes.
        and (same_axes or not is_additional(item.parameter))
    }


def _changes(
    keys: list[Key], items: list[CalibratedParameter], change: Floats, sigma: Floats
) -> tuple[ParameterChange, ...]:
    limit = single_limit(len(items))
    return tuple(
        ParameterChange(item.parameter, item.unit, float(d), float(s), bool(abs(d / s) > limit), head)
        for (_, head), item, d, s in zip(keys, items, change, sigma, strict=True)
    )


def _percent(probability: float) -> str:
    percent = 100.0 * probability
    if percent < 0.01:
        return "less than 0.01 %"
    return f"{percent:.0f} %" if percent >= 1.0 else f"{percent:.2f} %"


def _sentence(change: ParameterChange) -> str:
    """A change at the beginning of a sentence; names of sets are spelt small."""
    said = change.sentence
    return said if ":" in change.parameter else said[0].upper() + said[1:]
