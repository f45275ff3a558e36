"""The search for gross errors: adjust, reject the largest, adjust again, until none is left."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Bools
from adjust.errors import InconsistentBlockError
from adjust.least_squares import Adjusted, Adjuster
from adjust.quality.rejection import Rejection, reject
from adjust.solve.normal_equations import Observations


@dataclass(frozen=True, eq=False)
class Search:
    """Where the search for gross errors stands.

    Attributes
    ----------
    given : all observations with their present weights, whatever became of them.
    adjusted : the last adjustment, of those that are left.
    rejected : for each group (n,) the observations that were rejected.
    per_pass : how many each pass rejected.
    """

    given: Observations
    adjusted: Adjusted
    rejected: tuple[Bools, ...]
    per_pass: tuple[int, ...]

    @classmethod
    def start(cls, given: Observations, adjusted: Adjusted) -> Search:
        """Nothing rejected yet."""
        nothing = tuple(np.zeros(len(group.image), dtype=bool) for group in given.groups)
        return cls(given, adjusted, nothing, ())


def snoop(adjuster: Adjuster, search: Search, critical_value: float) -> Search:
    """Reject until no controlled standardized residual exceeds the critical value.

    Raises
    ------
    InconsistentBlockError : if the most passes that are allowed do not suffice.
    """
    for _ in range(adjuster.options.most_passes):
        found = reject(search.adjusted.observations, search.adjusted.residuals, critical_value)
        if found.count == 0:
            return search
        search = replace(
            search,
            adjusted=adjuster.again(search.adjusted, without(search.adjusted.observations, found)),
            rejected=tuple(a | b for a, b in zip(search.rejected, found.rejected, strict=True)),
            per_pass=(*search.per_pass, found.count),
        )
    raise InconsistentBlockError(
        f"After {adjuster.options.most_passes} passes of rejection there are still standardized residuals "
        f"above {critical_value}. The critical value is too small for these weights."
    )


def without(observations: Observations, rejection: Rejection) -> Observations:
    """The observations that remain after a pass of rejection."""
    of_rays = rejection.rejected[0].copy()
    of_rays[rejection.dropped] = True
    return Observations(
        observations.image_points.without(of_rays),
        tuple(
            group.without(mask)
            for group, mask in zip(observations.others, rejection.rejected[1:], strict=True)
        ),
    )
