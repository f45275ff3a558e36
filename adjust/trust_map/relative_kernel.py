"""How points move with the orientations of their images, and differences of two of them, compiled.

F = G B,    difference: F_a − F_b,    image by image.
"""

import numpy as np

from adjust.compiled import kernel, small_kernel
from adjust.trust_map.lane_kernel import LANES, add_product, add_six_rows, clear

# Unknowns whose products are added up before they are added to those of others: as many as an image has.
_SIX = 6


@small_kernel
def whole_sixes(count):
    """The next multiple of six."""
    return _SIX * (-(-count // _SIX))


@small_kernel
def weigh(f, o, gain, g, values, v, m):
    """Fill a row with the gains of a ray times two rows: derivatives of x and y."""
    for n in range(m):
        f[np.uintp(o + n)] = (
            gain[np.uintp(g + n)] * values[np.uintp(v + n)]
            + gain[np.uintp(g + 3 * LANES + n)] * values[np.uintp(v + LANES + n)]
        )


@small_kernel
def add_weighed(f, o, gain, g, values, v, m):
    """Add the gains of a ray times two rows."""
    for n in range(m):
        f[np.uintp(o + n)] += (
            gain[np.uintp(g + n)] * values[np.uintp(v + n)]
            + gain[np.uintp(g + 3 * LANES + n)] * values[np.uintp(v + LANES + n)]
        )


@kernel
def of_unknowns(k, m, d, place, gain, of_exposure, of_system, errors, of_known, f, of_errors):
    """Fill f (d, 3, m) with G B by z of m cells, and of_errors (q, 3, m) by considered errors.

    Behind both stand zeros, up to whole sixes.
    """
    width = place.shape[1]
    clear(f, 18 * k * m, 3 * (whole_sixes(d) - 6 * k) * m)
    clear(of_errors, 0, 3 * whole_sixes(errors) * m)
    for a in range(k):
        for c in range(3):
            g = (6 * a + c) * LANES
            for q in range(6):
                i = 6 * a + q
                weigh(f, (3 * i + c) * m, gain, g, of_exposure, 2 * i * LANES, m)
            for s in range(width):
                if place[a, s] >= 0:
                    at = 2 * (width * a + s) * LANES
                    add_weighed(f, (3 * place[a, s] + c) * m, gain, g, of_system, at, m)
            for q in range(errors):
                add_weighed(of_errors, (3 * q + c) * m, gain, g, of_known, 2 * (errors * a + q) * LANES, m)


@small_kernel
def _three_rows(values, at, m):
    """Three rows of m numbers that follow each other."""
    return values[np.uintp(at)], values[np.uintp(at + m)], values[np.uintp(at + 2 * m)]


@kernel
def _add_covariances(m, d, f, movement, of_cell, first):
    """Add F Q Fᵀ to six rows; of whole sixes of unknowns, so that their sums stay in registers."""
    for i in range(whole_sixes(d) // _SIX):
        for n in range(m):
            xu, xv, xw, yv, yw, zw = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for q in range(_SIX):
                own = 3 * m * (_SIX * i + q) + n
                x, y, z = _three_rows(f, own, m)
                u, v, w = _three_rows(movement, own, m)
                xu, xv, xw = xu + x * u, xv + x * v, xw + x * w
                yv, yw, zw = yv + y * v, yw + y * w, zw + z * w
            add_six_rows(of_cell, first * LANES + n, xu, xv, xw, yv, yw, zw)


@kernel
def covariances(m, d, f, movement, errors, of_errors, of_cell, first):
    """Fill six rows of of_cell with F Q Fᵀ, with what considered errors add; movement (d, 3, m) is Q Fᵀ."""
    clear(of_cell, first * LANES, 6 * LANES)
    _add_covariances(m, d, f, movement, of_cell, first)
    _add_covariances(m, errors, of_errors, of_errors, of_cell, first)


@kernel
def _add_differences(m, d, f, movement, total):
    """Add the variances of F of a cell less that of the next one, of whole sixes of unknowns."""
    for i in range(whole_sixes(d) // _SIX):
        for c in range(3):
            for n in range(m):
                value = 0.0
                for q in range(_SIX):
                    at = np.uintp((3 * (_SIX * i + q) + c) * m + n)
                    following = at + np.uintp(1)
                    value += (f[at] - f[following]) * (movement[at] - movement[following])
                total[np.uintp(c * LANES + n)] += value


@kernel
def variances_of_differences(m, d, f, movement, errors, of_errors, total):
    """Fill three rows of total with the variances of F of a cell less that of the next one.

    Q is the same for both, so that movement (d, 3, m), Q Fᵀ, needs only to be subtracted, too. The last cell
    has no next one: what it gets has no meaning.
    """
    clear(total, 0, 3 * LANES)
    _add_differences(m, d, f, movement, total)
    _add_differences(m, errors, of_errors, of_errors, total)


@kernel
def variances(m, d, f, movement, errors, of_errors, total):
    """Fill three rows of total with the diagonals of F Q Fᵀ, with what considered errors add."""
    clear(total, 0, 3 * LANES)
    for i in range(d):
        for c in range(3):
            add_product(total, c * LANES, f, (3 * i + c) * m, movement, (3 * i + c) * m, m)
    for i in range(errors):
        for c in range(3):
            add_product(total, c * LANES, of_errors, (3 * i + c) * m, of_errors, (3 * i + c) * m, m)


@kernel
def subtract(count, one, other):
    """One array less another, in place."""
    for n in range(count):
        one[np.uintp(n)] -= other[np.uintp(n)]
