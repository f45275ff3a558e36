"""Redundancy numbers and test statistics of image points from their hat matrices, compiled."""

import numpy as np

from adjust.compiled import kernel


@kernel
def statistics_of_rays(
    residual, hat, sigma, active, added, least, redundancy, standardized, detectable, non_centrality,
):  # fmt: skip
    """Fill redundancy, standardized and detectable (n, 2), NaN where not used; returns vᵀPv.

    hat (n, 3) holds the elements xx, xy, yy of the hat matrices; added (n, 2) variances by errors of
    considered parameters in units of σ², None without any. Where the redundancy number is not above ``least``
    nothing is divided by it. A residual that does not exist counts as zero.
    """
    squares = 0.0
    for i in range(residual.shape[0]):
        for c in range(2):
            redundancy[i, c] = np.nan
            standardized[i, c] = np.nan
            detectable[i, c] = np.nan
            if not active[i]:
                continue
            r = 1.0 - hat[i, 2 * c]
            redundancy[i, c] = r
            whitened = 0.0 if np.isnan(residual[i, c]) else residual[i, c] / sigma[i, c]
            squares += whitened * whitened
            if r > least:
                root = np.sqrt(r)
                growth = 1.0
                if added is not None:  # decided when it is compiled
                    growth = np.sqrt(1.0 + added[i, c] / r)
                standardized[i, c] = whitened / root / growth
                detectable[i, c] = non_centrality * sigma[i, c] / root * growth
    return squares


@kernel
def largest_controlled(control, standardized, least):
    """Largest |w| (n,) over the components (n, m) of each observation whose control is not below a limit."""
    largest = np.zeros(control.shape[0])
    for i in range(control.shape[0]):
        for c in range(control.shape[1]):
            size = abs(standardized[i, c])
            if control[i, c] >= least and size > largest[i]:
                largest[i] = size
    return largest
