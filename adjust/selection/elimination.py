"""The selection of additional parameters: one is eliminated at a time, every decision with its reason.

All steps are exact updates of one linearised solution, so that hundreds of them cost less than a single
adjustment. The update runs over all system parameters: what stays in any case (focal length, principal point,
boresight, …) is correlated with the candidates and changes with them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy import special

from adjust.arrays import Bools, Floats, Ints
from adjust.selection.correlation import correlation_matrix, total_correlation_within
from adjust.selection.determinability import (
    INSEPARABLE,
    PRIOR_ONLY,
    entangled_with,
    own_part,
    part_of_prior,
)
from adjust.selection.linear_estimate import LinearEstimate
from adjust.selection.significance import entering_t_values, limit_of_t, t_values

# Redundancy from which Student's distribution is the normal one for this purpose.
_MANY = 100


@dataclass(frozen=True)
class EliminationRules:
    """Criteria by which parameters are dropped one at a time, in this order.

    What the block does not determine goes first, whatever the rules.

    Attributes
    ----------
    name : of the preset.
    pairwise : of two candidates correlated by more than this the one with the smaller t goes; None: no test.
    total : total correlation R within the candidates above which a parameter goes; None: no test.
    total_spares_significant : it goes then only if its t is below the limit, too.
    error_probability : α of the two-sided limit of t; None where ``fixed_limit`` holds.
    fixed_limit : of t; below a redundancy of 100 Student's limit of the same probability, which is larger.
    entry : α of the two-sided limit of t with which a dropped parameter is taken back; None: none is.
    """

    name: str
    pairwise: float | None
    total: float | None
    total_spares_significant: bool
    error_probability: float | None
    fixed_limit: float | None
    entry: float | None

    def limit(self, redundancy: int | None) -> float:
        """Limit of |t| below which a parameter is not significant; redundancy None for a known σ0."""
        if self.fixed_limit is None:
            assert self.error_probability is not None
            return limit_of_t(self.error_probability, redundancy)
        if redundancy is None or redundancy >= _MANY:
            return self.fixed_limit
        return limit_of_t(2.0 * float(special.ndtr(-self.fixed_limit)), redundancy)

    def entry_limit(self, redundancy: int | None) -> float | None:
        """Limit of |t| above which a dropped parameter comes back."""
        return None if self.entry is None else limit_of_t(self.entry, redundancy)


#: Correlated pairs, then what is neither separable nor significant, then what is not significant at 1 %.
DEFAULT = EliminationRules("default", 0.90, 0.95**0.5, True, 0.01, None, 0.005)
#: As recalled of the BLUH program, not from a document: t < 1, |r| > 0.85, total correlation > 0.85.
BLUH = EliminationRules("bluh", 0.85, 0.85, False, None, 1.0, None)
#: The decisions of DMC certificates: of 70 parameters the smallest kept |t| is 2.17, so 95 % two-sided.
DMC_CERTIFICATE = EliminationRules("dmc_certificate", None, None, False, None, 1.96, None)

#: The presets by name.
PRESETS: Mapping[str, EliminationRules] = {rules.name: rules for rules in (DEFAULT, BLUH, DMC_CERTIFICATE)}


class Action(StrEnum):
    """What was decided about a parameter."""

    ELIMINATED = "eliminated"
    TAKEN_BACK = "taken_back"
    KEPT = "kept"


class Criterion(StrEnum):
    """By which criterion."""

    DETERMINABILITY = "determinability"
    CORRELATION = "correlation"
    TOTAL_CORRELATION = "total_correlation"
    SIGNIFICANCE = "significance"


@dataclass(frozen=True)
class Decision:
    """One decision about one parameter.

    Attributes
    ----------
    parameter : its index.
    name : its name.
    action, criterion : what was decided, and by what.
    reason : in words.
    t : |t| at that moment; NaN where the parameter could not be estimated.
    limit : of |t| at that moment.
    """

    parameter: int
    name: str
    action: Action
    criterion: Criterion
    reason: str
    t: float
    limit: float


@dataclass(frozen=True, eq=False)
class Elimination:
    """The outcome of a selection.

    Attributes
    ----------
    estimate : with what is left free.
    candidates : (g,) which could be dropped.
    decisions : in the order in which they were taken; those to keep a parameter come last.
    """

    estimate: LinearEstimate
    candidates: Bools
    decisions: tuple[Decision, ...]

    @property
    def kept(self) -> Bools:
        """(g,) candidates that are kept."""
        return self.candidates & self.estimate.free

    @property
    def eliminated(self) -> Bools:
        """(g,) candidates that are dropped."""
        return self.candidates & ~self.estimate.free

    def verdict(self, parameter: int) -> str:
        """The final decision on a candidate, in the wording of calibration certificates."""
        return "is significant" if self.estimate.free[parameter] else "is eliminated"


def eliminate(
    estimate: LinearEstimate, candidates: Bools, rules: EliminationRules, sigma0: float | None = None
) -> Elimination:
    """Drop candidates one at a time until no rule is violated, then test the dropped ones again.

    A parameter that is taken back is tested like the others from then on, and comes back once only.

    Parameters
    ----------
    candidates : (g,) which may be dropped; those that the estimate holds could not be determined.
    sigma0 : a known σ0; None takes that of the estimate at every step.
    """
    selection = _Selection(estimate, candidates, rules, sigma0)
    decisions = list(selection.not_estimated())
    returned = np.zeros(len(candidates), dtype=bool)
    while True:
        while (found := selection.violation()) is not None:
            decisions.append(found)
            selection = selection.on(selection.estimate.without(found.parameter))
        back = selection.best_return(~returned)
        if back is None:
            break
        decisions.append(back)
        returned[back.parameter] = True
        selection = selection.on(selection.estimate.with_free(back.parameter))
    return Elimination(selection.estimate, candidates, (*decisions, *selection.kept()))


@dataclass(frozen=True, eq=False)
class _Selection:
    """A selection under way: the estimate of the moment and what is asked of it."""

    estimate: LinearEstimate
    candidates: Bools
    rules: EliminationRules
    sigma0: float | None

    def on(self, estimate: LinearEstimate) -> _Selection:
        return _Selection(estimate, self.candidates, self.rules, self.sigma0)

    @property
    def tested(self) -> Ints:
        """Indices of the candidates that are free."""
        return np.flatnonzero(self.candidates & self.estimate.free)

    @property
    def redundancy(self) -> int | None:
        return self.estimate.redundancy if self.sigma0 is None else None

    @property
    def limit(self) -> float:
        return self.rules.limit(self.redundancy)

    @property
    def t(self) -> Floats:
        return np.asarray(np.abs(t_values(self.estimate, self.sigma0)))

    def violation(self) -> Decision | None:
        """The most serious violation of the rules by a candidate."""
        if len(self.tested) == 0:
            return None
        return (
            self._undetermined() or self._correlated() or self._totally_correlated() or self._insignificant()
        )

    def not_estimated(self) -> Iterator[Decision]:
        """Decisions about candidates that could not even be estimated together with the others."""
        for d in np.flatnonzero(self.candidates & ~self.estimate.free):
            others = self._names(entangled_with(self.estimate, int(d)))
            beside = f": it cannot be separated from {others}" if others else ": no observation depends on it"
            reason = f"not determinable in this block{beside}"
            yield self._decision(
                int(d), Action.ELIMINATED, Criterion.DETERMINABILITY, reason, float("nan"), self.limit
            )

    def kept(self) -> Iterator[Decision]:
        """Decisions about what is left."""
        t, limit = self.t, self.limit
        for d in self.tested:
            reason = f"|t| = {t[d]:.2f} exceeds {limit:.2f}{self._probability(self.rules.error_probability)}"
            yield self._decision(int(d), Action.KEPT, Criterion.SIGNIFICANCE, reason, float(t[d]), limit)

    def best_return(self, allowed: Bools) -> Decision | None:
        """The dropped candidate with the largest t, if that suffices to come back."""
        limit = self.rules.entry_limit(self.redundancy)
        waiting = self.candidates & ~self.estimate.free & allowed
        if limit is None or not waiting.any():
            return None
        with np.errstate(invalid="ignore"):
            usable = waiting & (self.estimate.determined_part() > INSEPARABLE)
            t = np.where(usable, np.abs(entering_t_values(self.estimate, self.sigma0)), 0.0)
        d = int(np.argmax(t))
        if t[d] <= limit:
            return None
        entry = self._probability(self.rules.entry)
        reason = f"|t| = {t[d]:.2f} among the remaining parameters exceeds {limit:.2f}{entry}"
        return self._decision(d, Action.TAKEN_BACK, Criterion.SIGNIFICANCE, reason, float(t[d]), limit)

    def _undetermined(self) -> Decision | None:
        part, of_prior = own_part(self.estimate)[self.tested], part_of_prior(self.estimate)[self.tested]
        worst = int(np.argmin(part))
        if part[worst] < INSEPARABLE:
            d = int(self.tested[worst])
            others = self._names(entangled_with(self.estimate, d))
            left = f"1 − R² = {part[worst]:.1g}"
            reason = f"not determinable: this block can hardly separate it from {others} ({left})"
        elif np.nanmax(of_prior, initial=0.0) > PRIOR_ONLY:
            worst = int(np.nanargmax(of_prior))
            d = int(self.tested[worst])
            reason = f"not determinable: its σ is {100 * of_prior[worst]:.0f} % of the prior σ"
        else:
            return None
        return self._eliminated(d, Criterion.DETERMINABILITY, reason)

    def _correlated(self) -> Decision | None:
        if self.rules.pairwise is None:
            return None
        correlation = np.abs(correlation_matrix(self.estimate.cofactor[np.ix_(self.tested, self.tested)]))
        np.fill_diagonal(correlation, 0.0)
        pair = np.unravel_index(int(np.argmax(correlation)), correlation.shape)
        if not correlation[pair] > self.rules.pairwise:
            return None
        first, second = (int(self.tested[k]) for k in pair)
        d, other = (first, second) if self.t[first] < self.t[second] else (second, first)
        reason = (
            f"correlated {100 * correlation[pair]:.0f} % with {self.estimate.normals.names[other]}, "
            f"whose |t| = {self.t[other]:.2f} is larger"
        )
        return self._eliminated(d, Criterion.CORRELATION, reason)

    def _totally_correlated(self) -> Decision | None:
        if self.rules.total is None:
            return None
        total = total_correlation_within(self.estimate, self.candidates)[self.tested]
        t = self.t[self.tested]
        violating = total > self.rules.total
        if self.rules.total_spares_significant:
            violating &= t < self.limit
        if not violating.any():
            return None
        k = int(np.argmin(np.where(violating, t, np.inf)))
        reason = (
            f"total correlation {total[k]:.3f} with the other additional parameters exceeds "
            f"{self.rules.total:.3f}"
        )
        return self._eliminated(int(self.tested[k]), Criterion.TOTAL_CORRELATION, reason)

    def _insignificant(self) -> Decision | None:
        t = self.t[self.tested]
        k = int(np.argmin(t))
        if t[k] >= self.limit:
            return None
        probability = self._probability(self.rules.error_probability)
        reason = f"|t| = {t[k]:.2f} is below {self.limit:.2f}{probability}"
        return self._eliminated(int(self.tested[k]), Criterion.SIGNIFICANCE, reason)

    def _eliminated(self, d: int, criterion: Criterion, reason: str) -> Decision:
        return self._decision(d, Action.ELIMINATED, criterion, reason, float(self.t[d]), self.limit)

    def _decision(
        self, d: int, action: Action, criterion: Criterion, reason: str, t: float, limit: float
    ) -> Decision:
        return Decision(d, self.estimate.normals.names[d], action, criterion, reason, t, limit)

    def _names(self, parameters: Ints) -> str:
        names = [self.estimate.normals.names[k] for k in parameters]
        return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)

    @staticmethod
    def _probability(error_probability: float | None) -> str:
        return "" if error_probability is None else f" (two-sided, α = {100 * error_probability:g} %)"
