"""Rules for keeping additional parameters, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scipy import special

from adjust.selection.significance import limit_of_t

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
