"""Whether observations are of the block they are to be adjusted with, and their equations theirs.

The kernels do not look whether an index is in range; they would read foreign memory. A wrong shape would be
broadcast, a wrong index be that of another unknown.

Derivatives are compared with numerical differences. The unknowns of one kind move together, each by a part of
the step that is its own, so that a derivative with respect to a wrong one shows. A step too small leaves
rounding, one too large what is not linear; wrong derivatives differ at every size.
"""

from __future__ import annotations

from inspect import getattr_static
from typing import TYPE_CHECKING

import numpy as np

from adjust.arrays import Floats, Ints, require_shape
from adjust.block import Block
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.errors import InconsistentBlockError
from adjust.observations.base import JoinsPoints, Linearization, ObservationGroup, Term
from adjust.observations.direct import DirectObservations
from adjust.observations.gnss_position import GnssPositions
from adjust.observations.image_point import ImagePoints
from adjust.observations.ins_attitude import InsAttitudes
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    EXTERIOR_ORIENTATION,
    OBJECT_POINT,
    ParameterLayout,
    State,
)
from adjust.solve.joined_points import joined_points
from adjust.unknown_names import unknown_name

if TYPE_CHECKING:
    from adjust.solve.system import Observations

# Image coordinates beyond so many half formats are in pixels or millimetres.
_MOST_HALF_FORMATS = 10.0
# Focal lengths of less or more half formats (a field of view of a quarter of a degree) are in another unit.
_FOCAL_LENGTHS = 0.01, 500.0
# Part of the standard deviation by which an observation changes, powers of ten by which that is multiplied,
# and the part of the derivatives that may be wrong.
_STEP, _SIZES, _TOLERANCE = 0.01, (0, 2, -2, 4, -4, 6, -6, 8), 0.01


def refuse_others_than(block: Block, observations: Observations) -> None:
    """Refuse observations of images, cameras, flights or object points that the block does not have.

    Raises
    ------
    InconsistentBlockError : with the group, and what it lacks.
    """
    if not block.images:
        raise InconsistentBlockError("The block has no images.")
    _refuse_other_rays(block, observations.image_points)
    kind = "image" if block.rig is None else "event"
    entities = {parameters.family.name: len(parameters.entities) for parameters in block.system}
    for group in observations.groups:
        if group is not observations.image_points:
            _refuse_no_group(group)
        name = group.name
        # Only image points must have an object point; −1 elsewhere says that there is none.
        least = 0 if group is observations.image_points else -1
        _refuse_outside(name, "object point", group.point, len(block.points), least)
        _refuse_outside(name, kind, group.event, len(block.events), -1)
        _refuse_outside(name, "object point", np.concatenate(joined_points((group,))), len(block.points))
        if isinstance(group, (GnssPositions, InsAttitudes)):
            _refuse_outside(name, "camera", group.camera, len(block.cameras))
        if isinstance(group, GnssPositions):
            _refuse_outside(name, "flight", group.flight, len(block.flights))
        if isinstance(group, DirectObservations):
            family = group.family
            if family.name not in entities:
                raise InconsistentBlockError(f"{name}: the block has no {family.name}.")
            _refuse_outside(name, family.entity_kind, group.entity, entities[family.name])
        # Types of this package refuse arrays of other shapes, and its tests know their derivatives.
        if not type(group).__module__.startswith("adjust."):
            _refuse_wrong_equations(block, block.approximate_state(), group)


def _refuse_no_group(group: ObservationGroup) -> None:
    """Refuse what is no group of observations, or numbers its events and object points with no array."""
    # As isinstance looks for them from Python 3.12 on, and where a second object point is looked for.
    public = [name for name in dir(ObservationGroup) if name[0] != "_"]
    missing = [name for name in public if getattr_static(group, name, None) is None]
    if missing:
        unseen = " What its `__getattr__` returns does not count." if hasattr(group, missing[0]) else ""
        raise InconsistentBlockError(
            f"A {type(group).__name__} is no group of observations: it has no {', '.join(missing)}.{unseen}"
        )
    for name in ("event", "point"):
        index = getattr(group, name)
        if not isinstance(index, np.ndarray) or index.dtype.kind not in "iu":
            raise InconsistentBlockError(f"{group.name}: {name} is not an array of integers.")


def _refuse_other_rays(block: Block, rays: ImagePoints) -> None:
    _refuse_outside(rays.name, "image", rays.image, len(block.images))
    if not np.array_equal(rays.camera_of_image, block.camera_of_image):
        raise InconsistentBlockError(
            "The image points do not have the same camera of every image as the block."
        )
    known = rays.event_of_image
    if (known is None) != (block.rig is None) or (
        known is not None and not np.array_equal(block.event_of_image, known)
    ):
        raise InconsistentBlockError("The image points do not contain the event of every image of the block.")
    for camera in block.cameras:
        side = max(camera.half_format)
        if not _FOCAL_LENGTHS[0] < camera.focal_length / side < _FOCAL_LENGTHS[1]:
            raise InconsistentBlockError(
                f"The focal length of {camera.name} is {camera.focal_length:.6g}, and half the side of its "
                f"image {side:.6g} m: focal length and pixel size are in metres."
            )
    half = max((max(camera.half_format) for camera in block.cameras), default=np.inf)
    farthest = np.abs(rays.xy).max(initial=0.0)
    if farthest > _MOST_HALF_FORMATS * half:
        raise InconsistentBlockError(
            f"An image coordinate is {farthest:.6g}, and half the side of the largest image {half:.6g} m: "
            "image coordinates are in metres from the centre of the format (FrameCamera.image_from_pixel)."
        )
    if rays.sigma.min(initial=np.inf) > half and len(rays.sigma):
        raise InconsistentBlockError(
            f"The standard deviations of all image coordinates are at least {rays.sigma.min():.6g}, and half "
            f"the side of the largest image {half:.6g} m: they are in metres."
        )


def refuse_other_calibration(block: Block, model: SelfCalibration | None) -> None:
    """Refuse additional parameters whose values and names the block does not have in the same places.

    Raises
    ------
    InconsistentBlockError : with what differs.
    """
    if model is None:
        return
    given = next((item for item in block.system if item.family.name == ADDITIONAL_PARAMETERS), None)
    if given is None:
        raise InconsistentBlockError(
            "The image points have additional parameters, and the block does not. Give their values to the "
            "block as SystemParameters."
        )
    names = given.family.components
    if tuple(model.names) != tuple(names):
        raise InconsistentBlockError(
            f"The additional parameters of the image points are {', '.join(model.names)}; those of the block "
            f"are {', '.join(names)}. They must be the same in the same order."
        )
    entities, index = len(given.entities), np.asarray(model.entity_of_image)
    require_shape("entity_of_image of the additional parameters", index.shape, (len(block.images),))
    if len(model.corrections) != entities or not ((index >= 0) & (index < entities)).all():
        raise InconsistentBlockError(
            f"The block has additional parameters of {entities} cameras; the image points have those of "
            f"{len(model.corrections)}, and their images the indices {index.min()} … {index.max()}."
        )
    number = {camera.name: k for k, camera in enumerate(block.cameras)}
    owner = np.array([number.get(name, -1) for name in given.entities], dtype=np.int64)[index]
    for image in np.flatnonzero((owner >= 0) & (owner != block.camera_of_image)):
        own, other = (block.cameras[camera[image]].name for camera in (block.camera_of_image, owner))
        raise InconsistentBlockError(
            f"Image {block.images[image]} is of the camera {own}, and has the additional parameters of "
            f"{other}."
        )


def _refuse_outside(group: str, kind: str, index: Ints, count: int, least: int = 0) -> None:
    if index.size and not (index.min() >= least and index.max() < count):
        raise InconsistentBlockError(
            f"An observation of {group} has an index of its {kind} outside 0 … {count - 1}."
        )


def _refuse_wrong_equations(block: Block, state: State, group: ObservationGroup) -> None:
    """Refuse a group whose equations at the approximate values are not those of its observations.

    Raises
    ------
    InconsistentBlockError : with the group, and what is wrong.
    UnknownNameError : a term is of a kind of unknowns that the block does not have.
    """
    name, shape = group.name, (len(group.point), len(group.components))
    require_shape(f"{name}: the array of weights", group.stochastic.present.shape, shape)
    equations = group.linearize(state)
    require_shape(f"{name}: the array of misclosures", np.shape(equations.misclosure), shape)
    if not np.isfinite(equations.misclosure[group.stochastic.present]).all():
        raise InconsistentBlockError(f"{name}: a misclosure is not finite at the approximate values.")
    terms = equations.terms
    if not isinstance(terms, (tuple, list)) or not all(isinstance(term, Term) for term in terms):
        raise InconsistentBlockError(f"{name}: `terms` of its equations is not a tuple of Term.")
    if not terms:
        raise InconsistentBlockError(f"{name}: its equations have no terms, so they depend on no unknown.")
    for term in terms:
        _refuse_wrong_term(block, state, name, shape, term)
    _refuse_other_points(group, equations)
    _refuse_connections(block, name, equations)
    refuse_wrong_derivatives(block.layout, state, group, equations)


def _refuse_wrong_term(block: Block, state: State, name: str, shape: tuple[int, int], term: Term) -> None:
    sizes = {EXTERIOR_ORIENTATION: (len(block.events), 6), OBJECT_POINT: (len(block.points), 3)}
    sizes |= {family: (values.shape[0], values.shape[1]) for family, values in state.system.items()}
    if term.block not in sizes:
        raise unknown_name(f"kind of unknowns, of which {name} has a term,", term.block, sizes)
    entities, parameters = sizes[term.block]
    what = f"{name}: the array of derivatives with respect to {term.block}"
    require_shape(f"{name}: the array of indices of {term.block}", np.shape(term.index), shape[:1])
    require_shape(what, np.shape(term.jacobian), (*shape, parameters))
    if not np.isfinite(term.jacobian).all():
        raise InconsistentBlockError(f"{what} is not finite at the approximate values.")
    # An observation without one, such as a position of no strip, has the index −1 and no derivative.
    nothing = (term.index == -1) & ~term.jacobian.any(axis=(1, 2))
    if not (nothing | ((term.index >= 0) & (term.index < entities))).all():
        raise InconsistentBlockError(f"{name}: an index of {term.block} is outside 0 … {entities - 1}.")


def _refuse_other_points(group: ObservationGroup, equations: Linearization) -> None:
    """Which object points an observation is of decides what is determined, and what is left out with them."""
    found = [term.index for term in equations.terms if term.block == OBJECT_POINT]
    stated = [group.point]
    if isinstance(group, JoinsPoints):
        stated.append(group.other_point)
        if len(group.components) > 1 or group.stochastic.over_time is not None:
            raise InconsistentBlockError(
                f"{group.name}: observations that join two object points have one component each, and errors "
                "independent of each other. Make an observation of every component."
            )
    elif not found and (group.point < 0).all():
        return
    if len(found) != len(stated) or not all(map(np.array_equal, found, stated)):
        raise InconsistentBlockError(
            f"{group.name}: the object points of its terms must be those that it states as `point`. Where an "
            "observation of one component joins two, it states the second as `other_point`, and the terms "
            "come in this order."
        )


def _refuse_connections(block: Block, name: str, equations: Linearization) -> None:
    """Object points are eliminated first, and that knows of no other connections than image points."""
    columns = block.layout.columns
    kinds = dict.fromkeys(
        term.block
        for term in equations.terms
        if term.block not in columns or (columns[term.block] >= 0).any()
    )
    others = [kind for kind in kinds if kind != OBJECT_POINT]
    if OBJECT_POINT in kinds and others:
        raise InconsistentBlockError(
            f"{name}: its equations connect object points with {' and '.join(others)}. Only image points may "
            "connect object points with other unknowns that are free."
        )


def refuse_wrong_derivatives(
    layout: ParameterLayout, state: State, group: ObservationGroup, equations: Linearization
) -> None:
    """Refuse a group whose derivatives are wrong by more than a hundredth at every size of the step.

    Parameters
    ----------
    equations : of the group at the state.

    Raises
    ------
    InconsistentBlockError : with the kind of unknowns, and by how much.
    """
    random = np.random.default_rng(35)
    for kind in dict.fromkeys(term.block for term in equations.terms):
        terms = tuple(term for term in equations.terms if term.block == kind)
        direction = _direction(layout, kind, random) * _step(group, terms)
        wrong = np.inf
        for power in _SIZES:
            wrong = min(wrong, _wrong_part(layout, state, group, terms, direction * 10.0**power))
            if wrong <= _TOLERANCE:
                break
        else:
            raise InconsistentBlockError(
                f"{group.name}: the derivatives with respect to {kind} are not those of the misclosures; "
                f"numerical differences differ from them by {100.0 * wrong:.3g} %. Derivatives are of the "
                "computed values: those of the misclosures with the opposite sign."
            )


def _step(group: ObservationGroup, terms: tuple[Term, ...]) -> Floats:
    """(d,) that changes no observation by more than a hundredth of its standard deviation."""
    sigma = np.where(group.stochastic.present, group.stochastic.sigma, np.inf)[:, :, None]
    largest = np.max([np.max(np.abs(t.jacobian) / sigma, axis=(0, 1), initial=0.0) for t in terms], axis=0)
    return np.asarray(np.divide(_STEP, largest, out=np.zeros_like(largest), where=largest > 0.0))


def _wrong_part(
    layout: ParameterLayout, state: State, group: ObservationGroup, terms: tuple[Term, ...], change: Floats
) -> float:
    """Largest difference between numerical and given change, relative to the sum of the given parts."""
    expected, size = np.zeros((2, *group.stochastic.present.shape))
    for term in terms:
        parts = term.jacobian * change[term.index][:, None, :]
        expected += parts.sum(axis=2)
        size += np.abs(parts).sum(axis=2)
    before, after = (
        group.linearize(_moved(layout, state, terms[0].block, sign * change)).misclosure for sign in (-1, 1)
    )
    used = group.stochastic.present
    size = np.where(used, size, 0.0)
    # What hardly depends on these unknowns has derivatives of rounding errors.
    size += _TOLERANCE * size.max(axis=0, initial=0.0)
    error = np.abs(0.5 * (before - after) - expected)[used] / size[used]
    return float(np.max(np.where(np.isfinite(error), error, np.inf), initial=0.0))


def _moved(layout: ParameterLayout, state: State, kind: str, change: Floats) -> State:
    exposures, border = np.zeros((layout.events, 6)), np.zeros(layout.border)
    points = np.zeros((layout.points, 3))
    if kind == EXTERIOR_ORIENTATION:
        exposures = change
    elif kind == OBJECT_POINT:
        points = change
    else:
        free = layout.columns[kind] >= 0
        border[layout.columns[kind][free]] = change[free]
    return layout.update(state, exposures, border, points)


def _direction(layout: ParameterLayout, kind: str, random: np.random.Generator) -> Floats:
    """Of every unknown of a kind another part of the step, in either direction; zero of what is held."""
    free = np.ones((layout.events, 6) if kind == EXTERIOR_ORIENTATION else (layout.points, 3), dtype=bool)
    if kind in layout.columns:
        free = layout.columns[kind] >= 0
    size = random.uniform(0.5, 1.0, free.shape) * random.choice([-1.0, 1.0], free.shape)
    return np.where(free, size, 0.0)
