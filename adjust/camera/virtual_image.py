"""Virtual images: composed of the pictures of several heads by way of a plane below the platform.

The axes are those of the virtual image: x, y along its columns and against its rows, z up, the origin at its
projection centre. Head h stands at t_h and is turned by M_h (platform from head). A ray of a head meets the
plane at the distance Z below the platform, and from there goes on to the virtual image:

    d = M_h (x − x0, y − y0, −c)ᵀ,    λ = −(Z + t_3)/d_3,    G = t + λ d,    x_v = f (G_1, G_2)/Z.

The way is right for ground at this distance. Ground at h is displaced by f t_h (1/h − 1/Z), each head its own
way: there the heads' parts of the virtual image do not fit.

Derivatives, with D = (f λ/Z) (I − d e_3ᵀ/d_3) (first two rows) and M_h ← exp(μ) M_h:

    ∂x_v/∂μ = −D [d]×,    ∂x_v/∂(x, y) = D (m_1, m_2),    ∂x_v/∂c = −D m_3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.geometry import rotation


@dataclass(frozen=True, eq=False)
class PlatformHeads:
    """The h heads of a platform.

    Attributes
    ----------
    platform_from_head : (h, 3, 3) M.
    position : (h, 3) t, metres.
    interior : (h, 3) c, x0, y0, metres.
    half_format : (h, 2) half the sides of the pictures, metres.
    focal_length : f of the virtual image, metres.
    """

    platform_from_head: Floats
    position: Floats
    interior: Floats
    half_format: Floats
    focal_length: float

    def __len__(self) -> int:
        return len(self.position)

    def turned(self, small: Floats) -> Self:
        """The same heads after small rotations μ (h, 3) in the axes of the platform."""
        return replace(self, platform_from_head=rotation.exp(small) @ self.platform_from_head)

    def longer(self, change: Floats) -> Self:
        """The same heads with focal lengths that are longer by (h,) metres."""
        return replace(self, interior=self.interior + change[:, None] * np.array([1.0, 0.0, 0.0]))


@dataclass(frozen=True, eq=False)
class Composed:
    """Points (n,) of heads in the virtual image.

    Attributes
    ----------
    xy : (n, 2) metres.
    of_rotation : (n, 2, 3) derivatives by μ of the head of each.
    of_point : (n, 2, 2) by its image coordinates.
    of_focal_length : (n, 2) by c of the head.
    """

    xy: Floats
    of_rotation: Floats
    of_point: Floats
    of_focal_length: Floats


def composed(heads: PlatformHeads, head: Ints, xy: Floats, distance: Floats | float) -> Composed:
    """Where points (n, 2) of the pictures of heads (n,) come to lie in the virtual image.

    Parameters
    ----------
    xy : ideal image coordinates, metres.
    distance : Z, of the plane below the platform, metres; one number or (n,).
    """
    turn, place = heads.platform_from_head[head], heads.position[head]
    below = np.broadcast_to(np.asarray(distance, dtype=np.float64), head.shape)
    in_head = np.column_stack([xy - heads.interior[head, 1:], -heads.interior[head, 0]])
    d = np.einsum("nij,nj->ni", turn, in_head)
    depth = -(below + place[:, 2]) / d[:, 2]
    scale = heads.focal_length / below
    ground = place[:, :2] + depth[:, None] * d[:, :2]
    along = np.broadcast_to(np.eye(2, 3), (len(head), 2, 3)).copy()
    along[:, :, 2] -= d[:, :2] / d[:, 2:]
    along *= (scale * depth)[:, None, None]
    return Composed(
        scale[:, None] * ground,
        -along @ rotation.cross_matrix(d),
        along @ turn[:, :, :2],
        -(along @ turn[:, :, 2:])[:, :, 0],
    )


def in_heads(heads: PlatformHeads, head: Ints, virtual: Floats, distance: Floats | float) -> Floats:
    """The way back: image coordinates (n, 2) in the pictures of heads; NaN where the ray meets the back."""
    below = np.broadcast_to(np.asarray(distance, dtype=np.float64), head.shape)
    ground = np.column_stack([virtual * (below / heads.focal_length)[:, None], -below])
    p = np.einsum("nji,nj->ni", heads.platform_from_head[head], ground - heads.position[head])
    found = heads.interior[head, 1:] - heads.interior[head, :1] * p[:, :2] / p[:, 2:]
    return np.where(p[:, 2:] < 0.0, found, np.nan)


def covering_head(heads: PlatformHeads, virtual: Floats, distance: float) -> Ints:
    """Head (n,) whose picture fills a point of the virtual image: where it is least far out; −1: none."""
    return covering_heads(heads, virtual, distance)[:, 0]


def covering_heads(heads: PlatformHeads, virtual: Floats, distance: float) -> Ints:
    """The head whose picture fills each point of the virtual image, and the next one (n, 2); −1: none."""
    out = np.full((len(heads), len(virtual)), np.inf)
    for number in range(len(heads)):
        own = in_heads(heads, np.full(len(virtual), number), virtual, distance)
        part = np.abs(own) / heads.half_format[number]
        out[number] = np.where(np.isfinite(part).all(axis=1), part.max(axis=1), np.inf)
    best = np.argsort(out, axis=0, kind="stable")[:2]
    return np.asarray(np.where(np.take_along_axis(out, best, axis=0) <= 1.0, best, -1).T)


def composition_errors(
    true: PlatformHeads, used: PlatformHeads, virtual: Floats, composed_for: float, flown_at: float
) -> tuple[Floats, Ints]:
    """What is wrong in a virtual image, (n, 2) metres, and the head (n,) that fills each point; NaN without.

    Parameters
    ----------
    true, used : the heads as they are, and as they are taken to be when the image is composed.
    virtual : (n, 2) points of the virtual image.
    composed_for, flown_at : Z of the composition, and the distance at which the ground really is.
    """
    head = covering_head(used, virtual, composed_for)
    found = np.full(virtual.shape, np.nan)
    there = np.flatnonzero(head >= 0)
    picture = in_heads(used, head[there], virtual[there], composed_for)
    right = composed(true, head[there], picture, flown_at).xy
    found[there] = virtual[there] - right
    return found, head
