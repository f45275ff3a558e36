"""Whether a camera has drifted: its newest calibration against the one before, and against the first one.

Two tests each, both on the difference of what both calibrations have estimated: χ² of all parameters
together with the sum of both covariance matrices, and every single parameter against its own limit. The
comparison with the first calibration of the mounting finds what changes too slowly to be seen from one
calibration to the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from tasks.document_kit.table import Number, decimals_for
from tasks.quantities import KINDS, kind_of, shown, with_unit
from tasks.registry.compatibility import (
    Compatibility,
    ParameterChange,
    compatibility,
    single_limit,
)
from tasks.registry.contents import StoredCalibration
from tasks.registry.identity import heads_of

#: Probability with which each of the two tests calls an unchanged camera drifted.
DRIFT_PROBABILITY = 0.001

Against: TypeAlias = Literal["before", "first"]
_AGAINST: dict[Against, str] = {"before": "the one before", "first": "the first of this mounting"}


@dataclass(frozen=True)
class DriftLimits:
    """How much a parameter may change.

    Attributes
    ----------
    sigma : in σ of the change; None: what the largest of all compared parameters exceeds by chance once in a
        thousand times (3.3 for one, 3.7 for five, 3.9 for nine).
    focal_length_um, principal_point_um, boresight_deg, lever_arm_mm : besides, whatever the σ; None: no such
        limit.
    """

    sigma: float | None = None
    focal_length_um: float | None = None
    principal_point_um: float | None = None
    boresight_deg: float | None = None
    lever_arm_mm: float | None = None

    def of(self, change: ParameterChange, count: int) -> float:
        """The limit of one of `count` compared parameters, in its unit."""
        in_sigma = single_limit(count, DRIFT_PROBABILITY) if self.sigma is None else self.sigma
        absolute: float | None = getattr(self, DRIFT_LIMITS.get(kind_of(change.parameter), ""), None)
        statistical = in_sigma * change.sigma
        if absolute is None:
            return statistical
        # They are given as people say them.
        return min(statistical, absolute / shown(change.unit, "change").factor)


#: Kind of a parameter → field of its limit.
DRIFT_LIMITS = {
    kind.name: field
    for kind in KINDS.values()
    for field in (kind.key(shown(kind.unit, "change").unit),)
    if field in DriftLimits.__dataclass_fields__
}


@dataclass(frozen=True)
class ParameterDrift:
    """One parameter of the comparison.

    Attributes
    ----------
    change : how it differs.
    old : its value in the older calibration.
    limit : how much it may differ, in its unit.
    """

    change: ParameterChange
    old: float
    limit: float

    @property
    def exceeds(self) -> bool:
        """Whether its limit is exceeded."""
        return abs(self.change.change) > self.limit

    @property
    def words(self) -> str:
        """Focal length +7.8 µm (σ 1.7 µm, limit 6.2 µm)."""
        unit, factor, _ = shown(self.change.unit, "change")
        decimals = decimals_for(self.change.sigma * factor)
        change, sigma, limit = (
            with_unit(Number(value * factor, decimals, plus=signed), unit)
            for value, signed in ((self.change.change, True), (self.change.sigma, False), (self.limit, False))
        )
        return f"{self.change.words} {change} (σ {sigma}, limit {limit})"


@dataclass(frozen=True)
class Drift:
    """The newest calibration of a camera compared with an older one.

    Attributes
    ----------
    new, old : the calibrations.
    against : which one the older is.
    test : how they differ.
    chi2_limit : of χ² of all parameters together.
    parameters : the single ones, in the order of the newer record.
    """

    new: StoredCalibration
    old: StoredCalibration
    against: Against
    test: Compatibility
    chi2_limit: float
    parameters: tuple[ParameterDrift, ...]

    @property
    def has_drifted(self) -> bool:
        """Whether a limit is exceeded."""
        return self.test.chi2 > self.chi2_limit or any(one.exceeds for one in self.parameters)

    @property
    def sentence(self) -> str:
        """The comparison in words, with what exceeds its limit."""
        whole = (
            f"χ² {self.test.chi2:.1f} of {self.test.degrees_of_freedom} degrees of freedom, limit "
            f"{self.chi2_limit:.1f}"
        )
        beyond = [one.words for one in self.parameters if one.exceeds]
        verb = "has drifted from" if self.has_drifted else "agrees with"
        return (
            f"Calibration {self.new.id} {verb} calibration {self.old.id}, {_AGAINST[self.against]}: "
            f"{'; '.join([whole, *beyond])}."
        )


def drifts_of(items: Sequence[StoredCalibration], limits: DriftLimits) -> tuple[Drift, ...]:
    """The newest calibration of a camera against the one before and the first one of its mounting.

    Parameters
    ----------
    items : calibrations of one camera, oldest first (`by_day`). Those whose own calibration has refused them
        are used only if they were approved. At an approval with a reason (``--although``) of a calibration
        that nothing else spoke against, the comparison begins again: that change is known. Computed twice
        from one flight, a camera has two calibrations with the same errors: they are not compared.

    Returns
    -------
    drifts : none of a single calibration; the one before may be of another mounting, if this one has no
        other, and then boresight and lever arm are not compared.
    """
    known = [item for item in items if item.approval is not None or item.record.verdict != "refused"]
    settled = [index for index, item in enumerate(known) if _is_settled(item)]
    known = known[settled[-1] :] if settled else known
    if not known:
        return ()
    newest = known[-1]
    earlier = [item for item in known[:-1] if not _of_one_flight(item, newest)]
    if not earlier:
        return ()
    same = [item for item in earlier if item.camera.mounting_key == newest.camera.mounting_key]
    before = (same or earlier)[-1]
    pairs: list[tuple[StoredCalibration, Against]] = [(before, "before")]
    if same and same[0] is not before:
        pairs.append((same[0], "first"))
    return tuple(drift_between(newest, old, against, limits) for old, against in pairs)


def _of_one_flight(one: StoredCalibration, other: StoredCalibration) -> bool:
    """Whether two calibrations were made from files of the same flight."""
    files = set(one.record.inputs.values()) & set(other.record.inputs.values())
    return one.flown is not None and one.flown == other.flown and bool(files)


def drift_between(
    new: StoredCalibration, old: StoredCalibration, against: Against, limits: DriftLimits
) -> Drift:
    """Compare two calibrations of one camera."""
    test = compatibility(new.record, old.record)
    count, rank = len(test.changes), test.degrees_of_freedom
    heads = heads_of(old.record, new.record)
    values = {
        (item.parameter, heads[item.entity]): item.value
        for item in old.record.estimated
        if item.entity in heads
    }
    # Not needed by those who only list calibrations.
    from scipy import special

    return Drift(
        new,
        old,
        against,
        test,
        float(special.chdtri(rank, DRIFT_PROBABILITY)) if rank else 0.0,
        tuple(
            ParameterDrift(change, values[change.parameter, change.head], limits.of(change, count))
            for change in test.changes
        ),
    )


def by_day(items: Sequence[StoredCalibration]) -> list[StoredCalibration]:
    """Calibrations by the day of the flight, else that on which they were added."""
    return sorted(items, key=lambda item: (day_of(item), item.id))


def day_of(item: StoredCalibration) -> str:
    """The day of its flight, else that on which it was added, ISO 8601."""
    return item.flown.isoformat() if item.flown is not None else item.events[0].at[:10]


def _is_settled(item: StoredCalibration) -> bool:
    """Whether a reason for the change of the camera has been recorded."""
    approval = item.approval
    return approval is not None and bool(approval.although) and item.record.verdict != "refused"
