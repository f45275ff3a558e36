"""The search for gross errors: adjust, reject the largest, adjust again, until none is left.

In the end all that was rejected is tested against what remains, and what fits comes back, each
observation once: gross errors in its neighbourhood had made it look bad.

What is known beforehand of a parameter is never rejected. Where it contradicts the block, gross errors below
its contradiction cannot be told from what it causes, and are searched for without it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from adjust.arrays import Bools, Ints
from adjust.errors import AdjustmentError, InconsistentBlockError
from adjust.least_squares import Adjusted, Adjuster
from adjust.quality.readmission import Return, fitting_again
from adjust.quality.rejection import Rejection, SnoopingRule, contradicting_priors, reject
from adjust.quality.robust import robust_rejection
from adjust.solve.system import Observations


@dataclass(frozen=True, eq=False)
class Search:
    """State of the search for gross errors.

    Attributes
    ----------
    given : all observations with their present weights, whatever became of them.
    adjusted : the last adjustment, of those that are left.
    rejected : for each group (n,) the observations that are rejected.
    given_up : (m,) object points that are, with all that belongs to them.
    returned : for each group (n,), and (m,), what has come back once.
    per_pass : how many observations each pass rejected.
    inseparable : indices of control points one of which is wrong, and it cannot be determined which.
    """

    given: Observations
    adjusted: Adjusted
    rejected: tuple[Bools, ...]
    given_up: Bools
    returned: tuple[Bools, ...]
    returned_points: Bools
    per_pass: tuple[int, ...] = ()
    inseparable: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @classmethod
    def start(cls, given: Observations, adjusted: Adjusted, rejected: Rejection | None = None) -> Search:
        """The state at the beginning: only what the adjustment has already excluded is rejected."""
        nothing = tuple(np.zeros(len(group.event), dtype=bool) for group in given.groups)
        no_point = np.zeros(len(adjusted.state.object_point), dtype=bool)
        if rejected is None:
            return cls(given, adjusted, nothing, no_point, nothing, no_point)
        per_pass = (rejected.count,)
        return cls(given, adjusted, rejected.rejected, rejected.given_up, nothing, no_point, per_pass)

    @property
    def taken_back(self) -> int:
        """Observations that were rejected, came back and stayed."""
        points = self.given.image_points.point
        of_points = self.returned_points[points] & ~self.given_up[points]
        stayed = [a & ~b for a, b in zip(self.returned, self.rejected, strict=True)]
        stayed[0] |= of_points & ~self.rejected[0]
        return int(sum(int(mask.sum()) for mask in stayed))

    def less(self, adjuster: Adjuster, found: Rejection) -> Search:
        """The state after an adjustment without the observations that a pass rejects."""
        left = replace(
            self,
            rejected=tuple(a | b for a, b in zip(self.rejected, found.rejected, strict=True)),
            given_up=self.given_up | found.given_up,
            per_pass=(*self.per_pass, found.count),
        )
        return replace(left, adjusted=adjuster.with_other_rejections(self.adjusted, left.remaining()))

    def more(self, adjuster: Adjuster, back: Return) -> Search:
        """The state after an adjustment with the observations that fit again."""
        of_points = back.points[self.given.image_points.point]
        came = (back.observations[0] | (of_points & self.rejected[0]), *back.observations[1:])
        left = replace(
            self,
            rejected=tuple(a & ~b for a, b in zip(self.rejected, came, strict=True)),
            given_up=self.given_up & ~back.points,
            returned=tuple(a | b for a, b in zip(self.returned, came, strict=True)),
            returned_points=self.returned_points | back.points,
        )
        adjusted = adjuster.with_other_rejections(self.adjusted, left.remaining(), back.state)
        return replace(left, adjusted=adjusted)

    def fitting_again(self, rule: SnoopingRule) -> Return:
        """Rejected observations that fit and have not been restored before."""
        once = tuple(a & ~b for a, b in zip(self.rejected, self.returned, strict=True))
        points = self.given_up & ~self.returned_points
        return fitting_again(self.adjusted, self.given, once, points, rule)

    def without_priors(self, adjuster: Adjuster, priors: tuple[Bools, ...]) -> Search:
        """The state after an adjustment without some of what is known beforehand."""
        left = replace(self, rejected=tuple(a | b for a, b in zip(self.rejected, priors, strict=True)))
        return replace(left, adjusted=adjuster.again(self.adjusted, left.remaining()))

    def with_priors(self, adjuster: Adjuster, priors: tuple[Bools, ...]) -> Search:
        """The state after an adjustment with them again, whether they fit or not."""
        rejected, returned = (
            tuple(a & ~b for a, b in zip(masks, priors, strict=True))
            for masks in (self.rejected, self.returned)
        )
        left = replace(self, rejected=rejected, returned=returned)
        return replace(left, adjusted=adjuster.again(self.adjusted, left.remaining()))

    def leaves_out_the_same_as(self, other: Search) -> bool:
        """Whether the same observations and object points are left out."""
        masks = zip((*self.rejected, self.given_up), (*other.rejected, other.given_up), strict=True)
        return all(np.array_equal(one, its) for one, its in masks)

    def remaining(self) -> Observations:
        """The remaining observations."""
        return without_rejected(self.given, Rejection(self.rejected, self.given_up))


def without_rejected(given: Observations, gone: Rejection) -> Observations:
    """The observations that are left, without those of given-up object points, too."""
    rays = given.image_points
    return Observations(
        rays.without(gone.rejected[0] | gone.given_up[rays.point]),
        tuple(group.without(mask) for group, mask in zip(given.others, gone.rejected[1:], strict=True)),
    )


def snoop(
    adjuster: Adjuster, search: Search, rule: SnoopingRule, complete: bool = True, priors: bool = True
) -> Search:
    """Reject until no controlled observation exceeds the critical value, then restore those that fit.

    Parameters
    ----------
    complete : adjust what is left to the end, and look at it again; otherwise it may count as stalled.
    priors : search once more without what is known beforehand and contradicts what is left.

    Raises
    ------
    InconsistentBlockError : if the most passes that are allowed do not suffice.
    """
    robust = adjuster.options.robust
    for _ in range(adjuster.options.most_passes):
        found = (
            reject(search.adjusted, rule)
            if robust is None
            else robust_rejection(adjuster, search.adjusted, robust, rule)
        )
        search = replace(search, inseparable=found.inseparable)
        if found.count == 0 and robust is not None:
            robust = None  # from here on nothing is weighted down any more
            continue
        if found.count:
            search = search.less(adjuster, found)
            continue
        back = search.fitting_again(rule)
        if back.count:
            search = search.more(adjuster, back)
        elif complete and search.adjusted.solution.stalled:
            search = replace(search, adjusted=adjuster.to_the_end(search.adjusted))
        else:
            return _behind_priors(adjuster, search, rule, complete) if priors else search
    raise InconsistentBlockError(
        f"After {adjuster.options.most_passes} passes of rejection there are still standardized "
        f"residuals above {rule.critical_value}. σ0 of what is left: {_sigmas0(search.adjusted)}. If σ0 "
        "of a group is far above 1, its stated σ are too small; otherwise the critical value is too "
        "small."
    )


def _behind_priors(adjuster: Adjuster, search: Search, rule: SnoopingRule, complete: bool) -> Search:
    """The search after another one without the priors that contradict; unchanged if that finds nothing."""
    priors = contradicting_priors(search.adjusted, rule)
    if not any(mask.any() for mask in priors):
        return search
    try:
        without = search.without_priors(adjuster, priors)
        found = snoop(adjuster, without, rule, complete=False, priors=False).with_priors(adjuster, priors)
    except AdjustmentError:  # together they determine what nothing else does
        return search
    if found.leaves_out_the_same_as(search):
        return search
    if complete and found.adjusted.solution.stalled:
        found = replace(found, adjusted=adjuster.to_the_end(found.adjusted))
    return found


def _sigmas0(adjusted: Adjusted) -> str:
    """σ0 of every group with redundancy, in words."""
    found = []
    for group, item in zip(adjusted.observations.groups, adjusted.residuals, strict=True):
        redundancy = float(np.nansum(item.redundancy))
        if redundancy > 1.0:
            sigma0 = float(np.sqrt(item.weighted_squares / redundancy))
            found.append(f"{group.name.replace('_', ' ')} {sigma0:.2f}")
    return ", ".join(found)
