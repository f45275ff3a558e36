"""Interior orientation of film images: from the coordinates of a scan to those of the calibrated camera.

A film image is placed in the scanner anyhow, and the film has shrunk. The fiducial marks of the camera, whose
coordinates its calibration report states, determine an affine transformation for every image,

    x = a0 + a1 x_s + a2 y_s,    y = b0 + b1 x_s + b2 y_s,

by least squares. The errors are those of the measured marks; x and y share the normal equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.errors import InconsistentBlockError

#: Marks that determine an affine transformation; each further one is a check of two equations.
FEWEST_MARKS = 3
# Smallest over largest eigenvalue of the places of the marks: less is a line.
_ON_A_LINE = 1e-6


@dataclass(frozen=True, eq=False)
class FilmOrientations:
    """Affine transformations of n images.

    Attributes
    ----------
    coefficients : (n, 2, 3) rows a0, a1, a2 and b0, b1, b2; lengths in the unit of the marks.
    cofactor : (n, 3, 3) of each row, for measured coordinates of unit weight.
    redundancy : (n,) number of redundant equations, x and y together.
    sigma0 : (n,) standard deviation of a measured coordinate; NaN without redundancy.
    residual : (k, 2) of the measured marks, computed − given.
    redundancy_number : (k,) of each coordinate of a mark.
    """

    coefficients: Floats
    cofactor: Floats
    redundancy: Ints
    sigma0: Floats
    residual: Floats
    redundancy_number: Floats

    def applied(self, image: Ints, xy: Floats) -> Floats:
        """Image coordinates (m, 2) of scanned points (m, 2) in the images (m,)."""
        return np.asarray(np.einsum("mij,mj->mi", self.coefficients[image], _design(xy)))


def film_orientations(images: int, image: Ints, measured: Floats, calibrated: Floats) -> FilmOrientations:
    """Affine transformations of all images.

    Parameters
    ----------
    image : (k,) index of the image in which each mark is measured.
    measured, calibrated : (k, 2) coordinates of the marks in the scan and in the calibration report.

    Raises
    ------
    InconsistentBlockError
        If an image has fewer than three marks, or all of its marks are on a line.
    """
    count = np.bincount(image, minlength=images)
    if images and count.min() < FEWEST_MARKS:
        raise InconsistentBlockError(
            f"Image {int(np.argmin(count))} has {int(count.min())} fiducial marks; an affine transformation "
            f"needs {FEWEST_MARKS}."
        )
    # About the middle of the marks the columns are of one size, and nearly orthogonal.
    middle = _sums(images, image, measured) / count[:, None]
    size = np.sqrt(np.mean((measured - middle[image]) ** 2))
    design = _design((measured - middle[image]) / size)
    normal = _sums(images, image, design[:, :, None] * design[:, None, :])
    values = np.linalg.eigvalsh(normal[:, 1:, 1:])
    flat = values[:, 0] < _ON_A_LINE * values[:, 1]
    if flat.any():
        raise InconsistentBlockError(f"The fiducial marks of image {int(np.argmax(flat))} are on a line.")
    cofactor = np.linalg.inv(normal)
    right = _sums(images, image, design[:, :, None] * calibrated[:, None, :])
    found = np.swapaxes(cofactor @ right, 1, 2)
    residual = np.einsum("kij,kj->ki", found[image], design) - calibrated
    redundancy = 2 * (count - 3)
    squares = _sums(images, image, (residual**2).sum(axis=1))
    sigma0 = np.sqrt(np.where(redundancy > 0, squares / np.maximum(redundancy, 1), np.nan))
    hat = np.einsum("ki,kij,kj->k", design, cofactor[image], design)
    back = _from_scan(middle, float(size))
    return FilmOrientations(
        found @ back,
        np.swapaxes(back, 1, 2) @ cofactor @ back,
        redundancy.astype(np.int64),
        sigma0,
        residual,
        1.0 - hat,
    )


def _design(xy: Floats) -> Floats:
    """Rows (k, 3): 1, x, y."""
    return np.column_stack([np.ones(len(xy)), xy])


def _sums(images: int, image: Ints, values: Floats) -> Floats:
    """Sums over the marks of each image (n, …)."""
    total = np.zeros((images, *values.shape[1:]))
    np.add.at(total, image, values)
    return total


def _from_scan(middle: Floats, size: float) -> Floats:
    """(n, 3, 3) matrices that turn 1, x_s, y_s into 1 and the reduced coordinates."""
    matrix = np.tile(np.diag([1.0, 1.0 / size, 1.0 / size]), (len(middle), 1, 1))
    matrix[:, 1:, 0] = -middle / size
    return matrix
