"""The search for the weights: adjust, estimate variance components and correlation times, adjust again.

With rejection the two searches hang together: wrong weights make good observations look like gross
errors, and gross errors inflate a component. So the weights start from medians of |w|, which gross
errors hardly move; then rejection and estimation take turns until neither changes anything.

A part whose σ are stated much too small holds what it observes, and its errors are in the orientations and
the other parts: it has hardly any redundancy, but would have it with the right weights. So what is weak
stands still only while its few residuals agree with its weights.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress

import numpy as np

from adjust.arrays import Bools, Floats
from adjust.data_snooping import Search, snoop
from adjust.errors import InconsistentBlockError
from adjust.least_squares import Adjuster
from adjust.quality.observation_parts import Part, correlations_of, parts_of
from adjust.quality.rejection import SnoopingRule
from adjust.quality.trace_matrix import trace_matrix
from adjust.quality.variance_components import (
    CONVERGED,
    LEAST_REDUNDANCY,
    PartSums,
    helmert_step,
    reweighted,
    robust_factors,
    variance_factors,
)

# Rounds of estimation within which factors settle; row sums of S/r are one, so it contracts.
_MOST_ROUNDS = 30
_MOST_TURNS = 10
# The medians need only be good enough that nothing sound looks like a gross error.
_ROUGHLY = 0.1
_MOST_ROUGH_ROUNDS = 6
# Residuals contradict the weights of a part so many σ beyond what is expected, with some redundancy at least.
# If they do so by chance, the part is estimated or, where it stays weak, keeps what was stated. Of 600 blocks
# of 10 to 24 images with the right weights that happened in six, with σ 1.6 to 1.8 times too large; with 3 in
# none, but σ of roll and pitch ten times too small were then found in 6 of 20 blocks in place of 15.
_BEYOND, _LEAST_DOUBTED = 2.0, 0.01
# Part of the step before above which one in the other direction is swinging, not settling.
_SWINGING = 0.4


@dataclass(frozen=True, eq=False)
class Weighted:
    """A search for gross errors with estimated weights.

    Attributes
    ----------
    search : with the observations reweighted.
    parts : the parts of the observations.
    factors : (parts,) estimated over stated standard deviation, or correlation time.
    frozen : (parts,) those that had too little redundancy in any round; they keep what was stated.
    rounds : number of adjustments with changed weights.
    """

    search: Search
    parts: tuple[Part, ...]
    factors: Floats
    frozen: Bools
    rounds: int

    @cached_property
    def sums(self) -> PartSums:
        """What the estimates are made of, at the present weights."""
        return PartSums.of(self.search.adjusted, self.parts)

    def moved(self, estimated: Floats) -> Floats:
        """Estimated factors (parts,) of this round; what stands stays, what is frozen goes back."""
        step = np.where(self.standing, 1.0, estimated)
        return np.where(self.frozen, 1.0 / self.factors, step)

    def frozen_where_weak(self) -> Weighted:
        """The same with the parts frozen whose redundancy is too small at settled weights.

        For good: a part that swings between frozen and free would never settle.
        """
        return replace(self, frozen=self.frozen | self.weak)

    @property
    def weak(self) -> Bools:
        """(parts,) those whose redundancy is too small at the present weights."""
        weak: Bools = self.sums.redundancy < LEAST_REDUNDANCY
        return weak | self._without_intervals()

    @cached_property
    def standing(self) -> Bools:
        """(parts,) those that are weak, and whose residuals agree with their weights.

        With the right weights of all parts Ω has the mean r and the variance 2 S, with S = tr(R²) of the part
        at least r²/n of its n observations.
        """
        adjusted, standing = self.search.adjusted, self.weak.copy()
        redundancy, excess = self.sums.redundancy, self.sums.squares - self.sums.redundancy
        count = [
            np.count_nonzero(adjusted.observations.groups[part.group].stochastic.present[part.place])
            for part in self.parts
        ]
        doubted = standing & ~self.frozen & (redundancy > _LEAST_DOUBTED)
        doubted &= excess > _BEYOND * redundancy * np.sqrt(2.0 / np.maximum(count, 1))
        doubted &= ~np.array([part.is_correlation for part in self.parts], dtype=bool)
        if doubted.any():
            parts = tuple(compress(self.parts, doubted))
            traces = trace_matrix(
                adjusted.system, adjusted.solution, parts, redundancy[doubted], adjusted.considered
            )
            standing[doubted] = excess[doubted] < _BEYOND * np.sqrt(2.0 * np.diagonal(traces))
        return standing

    def _without_intervals(self) -> Bools:
        """Correlation times (parts,) of strips in which no exposure follows another."""
        processes = [self.search.given.groups[part.group].stochastic.over_time for part in self.parts]
        return np.array(
            [
                part.is_correlation and process is not None and bool(np.isnan(process.interval))
                for part, process in zip(self.parts, processes, strict=True)
            ]
        )

    def changed(self, adjuster: Adjuster, step: Floats, near: bool = True) -> Weighted:
        """Adjusted again with the standard deviations of the parts multiplied by (parts,) factors.

        Parameters
        ----------
        near : as of ``Adjuster.adjust``.
        """
        before = self.search.adjusted
        adjusted = adjuster.again(before, reweighted(before.observations, self.parts, step), near=near)
        given = reweighted(self.search.given, self.parts, step)
        search = replace(self.search, given=given, adjusted=adjusted)
        return replace(self, search=search, factors=self.factors * step, rounds=self.rounds + 1)


def estimate_weights(adjuster: Adjuster, search: Search, rule: SnoopingRule | None) -> Weighted:
    """Variance components, correlation times, and with a rule the gross errors, from an adjustment as stated.

    Raises
    ------
    InconsistentBlockError : if the weights do not settle.
    """
    options = adjuster.options
    parts = parts_of(search.given, options.divisions)
    frozen = np.full(len(parts), not options.variance_components)
    if options.correlation_times:
        parts += correlations_of(search.given)
        frozen = np.append(frozen, np.zeros(len(parts) - len(frozen), dtype=bool))
    found = Weighted(search, parts, np.ones(len(parts)), frozen, 0)
    if rule is None:
        return _settled(adjuster, found)
    for _ in range(_MOST_ROUGH_ROUNDS):
        adjusted = found.search.adjusted
        step = found.moved(robust_factors(adjusted.observations, adjusted.residuals, parts))
        if np.all(np.abs(step - 1.0) < _ROUGHLY):
            break
        found = found.changed(adjuster, step)
    for number in range(_MOST_TURNS):
        search = snoop(adjuster, found.search, rule, complete=number > 0)
        unchanged = search.leaves_out_the_same_as(found.search)
        found = replace(found, search=search)
        if unchanged and number > 0:  # the first search has not seen the settled weights
            return found
        found = _settled(adjuster, found)
    raise InconsistentBlockError(
        f"After {_MOST_TURNS} turns variance components and rejection at {rule.critical_value} still change "
        "each other. The critical value is too small, or the residuals are far from normally distributed."
    )


def tolerances(found: Weighted) -> Floats:
    """Changes (parts,) below which factors have settled: 1 %, and a fifth of their standard deviation.

    σ̂_g has a relative standard deviation of about 1/√(2r); of many thousand image points that is below 1 %.
    """
    return np.minimum(CONVERGED, 0.2 / np.sqrt(2.0 * np.maximum(found.sums.redundancy, 1.0)))


def _settled(adjuster: Adjuster, found: Weighted) -> Weighted:
    """Weights that hardly change when they are estimated again, adjusted to the end.

    The last change is one that hardly changes them: a step of Newton's method leaves a small part of it.
    """
    times = any(part.is_correlation for part in found.parts)
    complete = not found.search.adjusted.solution.stalled
    last = np.zeros(len(found.parts))
    for number in range(_MOST_ROUNDS):
        # From far off the likelihood may lead a correlation time anywhere.
        simplified = times and number == 0
        step = found.moved(_estimated(found, simplified))
        small = bool(np.all(np.abs(step - 1.0) < tolerances(found)))
        if small:
            if simplified:
                continue  # it does not look at correlation times
            settled = found.frozen_where_weak()
            small = np.array_equal(settled.frozen, found.frozen)
            if small and complete:
                return found
            if not small:
                found = settled
                step = found.moved(np.ones(len(found.parts)))
                last[:] = 0.0
        if not simplified:  # which knows nothing of the others
            step = without_swinging(step, last)
            last = np.log(step)
        found, complete = found.changed(adjuster, step, near=not small), small
    worst = found.parts[int(np.argmax(np.abs(np.log(step))))]
    raise InconsistentBlockError(
        f"The variance components do not converge within {_MOST_ROUNDS} rounds; that of {worst.name} still "
        "changes. The block cannot separate the errors of its groups: adjust it without variance components."
    )


def without_swinging(step: Floats, last: Floats) -> Floats:
    """Factors (parts,) that stop where a part that turns back would cross zero if its steps were linear.

    Groups that borrow from each other, such as GNSS in plan and roll and pitch, may otherwise swing for long.

    Parameters
    ----------
    last : (parts,) logarithms of the factors of the round before.
    """
    logarithm = np.log(step)
    turns = (logarithm * last < 0.0) & (np.abs(logarithm) > _SWINGING * np.abs(last))
    part = np.abs(last) / np.where(turns, np.abs(last) + np.abs(logarithm), 1.0)
    factors: Floats = np.where(turns, np.exp(logarithm * part), step)
    return factors


def _estimated(found: Weighted, simplified: bool) -> Floats:
    """Factors (parts,) that this round estimates; simplified by Förstner's step, which never overshoots."""
    free = ~(found.frozen | found.standing)
    step = variance_factors(found.sums, found.parts)
    if not simplified and free.any():
        parts = tuple(part for part, is_free in zip(found.parts, free, strict=True) if is_free)
        step[free] = helmert_step(found.search.adjusted, parts, found.sums.redundancy[free], step[free])
    return step
