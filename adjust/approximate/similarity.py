"""Similarity transformations between two coordinate systems, also with some wrong points."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.geometry import rotation

# From so many points on, it can be determined which of them are wrong.
_JUDGED = 6
# Triples of points that are tried at most.
_TRIALS = 500
# Points this many times the median distance off are left out of the final fit.
_OFF = 5.0
# Rotations that may be the one nearest to the others.
_MIDDLES = 200
# The second largest extent of points below this part of the largest: they lie on a line.
_LINE = 0.02


@dataclass(frozen=True, eq=False)
class Similarity:
    """X' = scale · R X + shift.

    Attributes
    ----------
    scale : positive.  rotation : (3, 3).  shift : (3,).
    """

    scale: float
    rotation: Floats
    shift: Floats

    def points(self, x: Floats) -> Floats:
        """Points (..., 3) in the other system."""
        return np.asarray(self.scale * x @ self.rotation.T + self.shift)

    @classmethod
    def about(cls, scale: float, rotation: Floats, source: Floats, target: Floats) -> Similarity:
        """The similarity of known scale and rotation that moves one point (3,) onto another."""
        return cls(scale, rotation, target - scale * rotation @ source)


def on_a_line(x: Floats) -> bool:
    """Whether points (k, 3) are so close to one line that they do not determine a rotation about it."""
    if len(x) < 3:
        return True
    sizes = np.linalg.svd(x - x.mean(axis=0), compute_uv=False)
    return bool(sizes[1] < _LINE * sizes[0])


def fitted(source: Floats, target: Floats) -> Similarity:
    """The least-squares similarity between points (k, 3), k ≥ 3 not on a line (Umeyama 1991)."""
    middle, goal = source.mean(axis=0), target.mean(axis=0)
    centred = source - middle
    u, sizes, v = np.linalg.svd((target - goal).T @ centred)
    hand = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ v))])
    scale = float((sizes * hand).sum() / np.sum(centred**2))
    return Similarity.about(scale, u @ np.diag(hand) @ v, middle, goal)


def robustly_fitted(source: Floats, target: Floats) -> tuple[Similarity, Bools]:
    """The similarity on which most points (k, 3) agree, k ≥ 3 not on a line, and which of them agree.

    Of all triples (or some hundreds, if there are more) the one that leaves the least median distance.
    """
    best, least = fitted(source, target), np.inf
    if len(source) < _JUDGED:
        return best, np.ones(len(source), dtype=bool)
    for triple in _triples(len(source)):
        if on_a_line(source[triple]) or on_a_line(target[triple]):
            continue
        trial = fitted(source[triple], target[triple])
        median = float(np.median(np.linalg.norm(trial.points(source) - target, axis=1)))
        if median < least:
            best, least = trial, median
    off = np.linalg.norm(best.points(source) - target, axis=1)
    agreeing = off <= max(_OFF * float(np.median(off)), 1e-9 * float(np.ptp(target)))
    if agreeing.sum() < 3 or on_a_line(source[agreeing]):
        agreeing = np.ones(len(source), dtype=bool)
    return fitted(source[agreeing], target[agreeing]), agreeing


def _triples(count: int) -> Ints:
    """(t, 3) triples of points: all of them, or as many as are tried at random from a fixed seed."""
    if count * (count - 1) * (count - 2) // 6 <= _TRIALS:
        return np.array(list(combinations(range(count), 3)), dtype=np.int64)
    generator = np.random.default_rng(0)
    drawn = generator.random((_TRIALS, count)).argpartition(3, axis=1)[:, :3]
    return drawn.astype(np.int64)


def mean_rotation(rotations: Floats) -> Floats:
    """The mean (3, 3) of those rotations (k, 3, 3) that agree with the one nearest to the others.

    Of many, some hundred evenly spread ones are looked at: all pairs of 10,000 would take 7 GB.
    """
    tried = rotations[:: -(-len(rotations) // _MIDDLES)]
    distance = np.array([np.linalg.norm(one - rotations, axis=(1, 2)) for one in tried])
    middle = int(np.argmin(np.median(distance, axis=1)))
    near = distance[middle] <= max(3.0 * float(np.median(distance[middle])), 1e-6)
    u, _, v = np.linalg.svd(rotations[near].mean(axis=0))
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v)


def turned_about(axis: Floats, from_direction: Floats, to_direction: Floats) -> Floats:
    """Rotation (3, 3) about an axis (3,) that brings one direction (3,) as near to another as it can."""
    axis = axis / np.linalg.norm(axis)
    across = from_direction - axis * (axis @ from_direction)
    # What the other one has along the axis counts in neither product.
    angle = np.arctan2(axis @ np.cross(across, to_direction), across @ to_direction)
    return rotation.exp(angle * axis)


def between_directions(one: Floats, other: Floats) -> Floats:
    """The smallest rotation (3, 3) that turns one direction (3,) into another."""
    one, other = one / np.linalg.norm(one), other / np.linalg.norm(other)
    axis = np.cross(one, other)
    if np.linalg.norm(axis) < 1e-12:
        axis = np.eye(3)[int(np.argmin(np.abs(one)))]
        axis = np.cross(one, axis)
    return turned_about(axis, one, other)
