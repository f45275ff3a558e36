"""Platforms without pictures whose own rotation nothing tells from a common one of their heads.

A small turn g of a platform turns all its heads back. With a change db of its boresight b it changes the
observed attitudes by R(b) g − E(b) db, less the biases of their strips. What is known of all these leaves g
open in some directions or in none. Known positions of the heads would hide that behind pivots that look
sound: a degree is known from them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.block import Block
from adjust.errors import DatumDefectError
from adjust.geometry import rotation
from adjust.observations.direct import DirectObservations
from adjust.observations.ins_attitude import InsAttitudes
from adjust.observations.joint_prior import JointPrior
from adjust.parameters import BORESIGHT, INS_STRIP_BIAS, SystemParameters
from adjust.rig import RELATIVE_ROTATION

if TYPE_CHECKING:
    from adjust.solve.system import Observations

# A known angle that changes by less than this part of a rotation does not determine it.
_LEVERAGE = 0.01


def refuse_open_platforms(block: Block, observations: Observations) -> None:
    """Refuse such platforms.

    Raises
    ------
    DatumDefectError : with the parameters.
    """
    rig = block.rig
    if rig is None:
        return
    for platform in np.setdiff1d(rig.reference, rig.camera_of_image):
        heads = np.intersect1d(np.flatnonzero(rig.reference == platform), rig.camera_of_image)
        error = _defect(block, observations, int(platform), heads)
        if error is not None:
            raise error


def _defect(block: Block, observations: Observations, platform: int, heads: Ints) -> DatumDefectError | None:
    """What is open of a platform, by the heads that take its pictures; None if nothing is."""
    given = {parameters.family.name: parameters for parameters in block.system}
    of_heads, boresight, biases = given[RELATIVE_ROTATION], given[BORESIGHT], given.get(INS_STRIP_BIAS)
    open_heads, open_own = (_open(item, observations) for item in (of_heads, boresight))
    open_biases = np.zeros((0, 3), dtype=bool) if biases is None else _open(biases, observations)
    strips, observed = _attitudes(platform, observations, open_biases)
    turned, of_body = _turned_heads(of_heads.values[heads]), _turned_body(boresight.values[platform])
    held = np.concatenate([turned, np.zeros_like(turned)], axis=2)[~open_heads[heads]]
    turns = _unseen(np.concatenate([held, np.eye(6)[3:][~open_own[platform]], of_body[observed]]))
    if not (len(heads) and turns.size):
        return None
    own, bias = (np.abs(part @ turns).max(axis=1) > _LEVERAGE for part in (np.eye(6)[3:], of_body))
    moved = np.abs(turned @ turns[:3]).max(axis=2) > _LEVERAGE
    of_own = [boresight.quantity(platform, int(k)) for k in np.flatnonzero(own)]
    of_strips = [(int(k), int(c)) for k, c in np.argwhere(open_biases & bias) if k in strips]
    named = [
        *of_own,
        *(biases.quantity(k, c) for k, c in of_strips if biases is not None),
        *(of_heads.quantity(int(heads[h]), int(k)) for h, k in np.argwhere(moved & open_heads[heads])),
    ]
    words = ["its boresight"] * bool(of_own) + ["its INS strip biases"] * bool(of_strips)
    why = f": {', '.join(words)} and a common rotation of all its heads are one and the same."
    if not words:
        why = ", and nothing observes its attitude: a common rotation of all its heads is not determined."
    sentence = f"{block.cameras[platform].name} takes no pictures{why}"
    return DatumDefectError(turns.shape[1], tuple(str(quantity) for quantity in named), (sentence,))


def _attitudes(platform: int, observations: Observations, open_biases: Bools) -> tuple[Ints, Bools]:
    """Strips with attitudes of a platform, and the axes (3,) about which one has no open bias."""
    strips, observed = np.zeros(0, dtype=np.int64), np.zeros(3, dtype=bool)
    for group in observations.others:
        if not isinstance(group, InsAttitudes):
            continue
        known = group.stochastic.present & (group.camera == platform)[:, None]
        if group.motion is not None and len(open_biases):
            strips = np.union1d(strips, group.motion.strip[known.any(axis=1)])
            known = known & ~open_biases[group.motion.strip]
        observed |= known.any(axis=0)
    return strips, observed


def _turned_heads(angles: Floats) -> Floats:
    """Change (h, 3, 3) of the relative rotations (h, 3) of heads by a small turn g of their platform.

    R(ρ) becomes exp(−g) R(ρ), so E(ρ) dρ = −g.
    """
    return np.asarray(-np.linalg.inv(rotation.roll_pitch_yaw_jacobian(angles)))


def _turned_body(angles: Floats) -> Floats:
    """Change (3, 6) of the attitude seen from a boresight (3,) by (g, db): R(b) g − E(b) db."""
    turn = rotation.from_roll_pitch_yaw(angles)
    return np.concatenate([turn, -rotation.roll_pitch_yaw_jacobian(angles)], axis=1)


def _unseen(known: Floats) -> Floats:
    """Turns with the boresight (6, d) that change what is known (r, 6) by a small part of them at most."""
    values, vectors = np.linalg.eigh(known.T @ known)
    null = vectors[:, values < _LEVERAGE**2]
    # What moves the boresight alone is no turn.
    _, sizes, axes = np.linalg.svd(null[:3], full_matrices=False)
    return np.asarray(null @ axes[sizes > 0.1].T)


def _open(parameters: SystemParameters, observations: Observations) -> Bools:
    """Which parameters (e, d) of a family are free, and not observed."""
    found = parameters.free.copy()
    for group in observations.others:
        if isinstance(group, DirectObservations) and group.family == parameters.family:
            found[group.entity] &= ~group.stochastic.present
        elif isinstance(group, JointPrior):
            for place in group.places:
                if place.family == parameters.family.name:
                    found[place.entity, place.component] = False
    return found
