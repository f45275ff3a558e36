"""What the model of a block may lack: every alternative that is tested, one row each.

Parameters that are held, or that differ between flights, heights, directions or strips; drifts of GNSS and
INS; time offsets and height scale of GNSS; north and order of the attitudes; the datum of the control;
refraction; direction and sign of given distortion; image errors that no parameter describes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from adjust.arrays import Bools, Floats, Ints
from adjust.block import Block
from adjust.calibration.flight_pattern import flight_pattern
from adjust.camera.additional.register import additional_parameters
from adjust.geometry import rotation
from adjust.observations.control_point import ControlPoints
from adjust.observations.ins_attitude import InsAttitudes
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    BORESIGHT,
    GNSS_SHIFT,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    SystemParameters,
)
from adjust.quality.alternative_products import ModelAlternative
from adjust.quality.model_alternatives import ObservationAlternative, ParameterAlternative
from adjust.solve.system import Observations
from tasks.block.given_orientations import GivenOrientations
from tasks.block.refracted_rays import ground_heights
from tasks.block.self_calibration import image_format_of
from tasks.evaluation.alternative import Alternative, Scope, along_axis, scaled
from tasks.evaluation.alternative_words import LEAST_PART, WHOLE
from tasks.evaluation.gnss_ins_alternatives import drift_alternatives, position_alternatives
from tasks.evaluation.image_point_changes import image_errors, other_readings, refraction
from tasks.quantities import reported_unit

#: Families and the parts of a block in which they may differ.
_DIFFERING: dict[str, tuple[Scope, ...]] = {
    BORESIGHT: ("flight", "height", "strip"),
    LEVER_ARM: ("flight",),
    INTERIOR_ORIENTATION: ("flight", "height"),
    GNSS_SHIFT: ("height", "direction", "strip"),
}
_IMAGE_ERRORS = "brown"
# A correction that is missing, made twice or with the wrong sign is off by one or two times itself.
_MOST_OF_ITSELF = 3.0
# Less than this part of its height is not a relief, or no second height, that a scale could show in.
_FLAT = 1e-3
# Refraction that stays below this part of the σ of every image point (close range) explains nothing.
_NO_REFRACTION = 0.02
# Radians; a local system has one north only, and headings one order.
_NO_TURN = 1e-9
# An order is wrong as a whole or not at all: with a value of its own, it takes nothing of what is shared.
_CRITICAL_OF_ORDER = 6.0


@dataclass(frozen=True, eq=False)
class _Part:
    """Some of the images."""

    scope: Scope
    name: str
    images: Bools


@dataclass(frozen=True, eq=False)
class _Material:
    block: Block
    given: GivenOrientations
    observations: Observations
    parts: tuple[_Part, ...]


def model_alternatives(
    block: Block, given: GivenOrientations, observations: Observations, cameras: pd.DataFrame
) -> tuple[Alternative, ...]:
    """All alternatives of a block's model; already estimated parameters are not among them.

    Parameters
    ----------
    cameras : cameras.parquet.
    """
    material = _Material(block, given, observations, tuple(_parts(block, given, observations)))
    return (
        *_of_parameters(material),
        *drift_alternatives(block, given, observations),
        *position_alternatives(block, given, observations),
        *_of_attitudes(material),
        *_of_control(material),
        *_of_image_points(material, cameras),
    )


def _parts(block: Block, given: GivenOrientations, observations: Observations) -> Iterator[_Part]:
    """Flights, heights, directions and strips; a division into one part is omitted."""
    if len(given.flights) > 1:
        for number, name in enumerate(given.flights):
            yield _Part("flight", name, given.flight_of_image == number)
    centre = block.approximate_state().pictures.projection_centre
    height = block.frame.height(centre) - ground_heights(observations.image_points, block)
    heading = given.headings()
    strip = given.strip_of_image
    known = np.isfinite(height) & (height > 0.0) & np.isfinite(heading)
    if known.any():
        pattern = flight_pattern(heading[known], height[known], strip[known])
        with np.errstate(invalid="ignore", divide="ignore"):
            level = np.abs(np.log(height[:, None] / pattern.heights))
        turn = -np.cos(heading[:, None] - pattern.directions)
        names = _height_names(pattern.heights)
        yield from _division("height", names, _nearest(level, known))
        names = [f"{np.rad2deg(value):.0f}°" for value in pattern.directions]
        yield from _division("direction", names, _nearest(turn, known))
    if all(given.strip):
        for number, name in enumerate(given.strips):
            yield _Part("strip", name, strip == number)


def _nearest(distance: Floats, known: Bools) -> Ints:
    """(n,) index of the nearest of several values (n, k); −1 where not known."""
    return np.where(known, np.argmin(np.nan_to_num(distance, nan=np.inf), axis=1), -1)


def _height_names(heights: Floats) -> list[str]:
    """Heights in whole metres; where they would be the same, as in close range, with more digits."""
    for decimals in range(4):
        names = [f"{value:.{decimals}f} m" for value in heights]
        if len(set(names)) == len(names):
            break
    return names


def _division(scope: Scope, names: list[str], number: Ints) -> Iterator[_Part]:
    if len(names) > 1:
        for k, name in enumerate(names):
            yield _Part(scope, name, number == k)


def _of_parameters(material: _Material) -> Iterator[Alternative]:
    """Parameters that are held, and those that may differ between parts."""
    attitudes = any(isinstance(item, InsAttitudes) for item in material.observations.others)
    for parameters in material.block.system:
        family = parameters.family.name
        # Without attitudes a boresight turns the lever arm by nothing worth mentioning.
        if family not in _DIFFERING or (family == BORESIGHT and not attitudes):
            continue
        for (entity, component), free in np.ndenumerate(parameters.free):
            if not free and _is_of_body(material.block, family, entity):
                yield _parameter(parameters, entity, component, None)
        yield from _differing(material, parameters)


def _is_of_body(block: Block, family: str, entity: int) -> bool:
    """Whether it is not the boresight or lever arm of a head, which follow from the reference head."""
    return block.rig is None or family not in (BORESIGHT, LEVER_ARM) or bool(block.rig.is_reference[entity])


def _differing(material: _Material, parameters: SystemParameters) -> Iterator[Alternative]:
    """Parameters of a family that differ in one part; parts with the same images are tested once."""
    family = parameters.family.name
    # Shifts belong to flights: a height or direction has all of them.
    entities = [None] if family == GNSS_SHIFT else list(range(len(parameters.entities)))
    for entity in entities:
        own = np.ones(len(material.block.events), dtype=bool)
        if entity is not None:
            own = material.block.camera_of_event == entity
        seen: set[bytes] = set()
        for part in material.parts:
            events = part.images[material.block.image_of_event] & own
            if part.scope not in _DIFFERING[family] or not events.any() or events.sum() == own.sum():
                continue
            if events.tobytes() in seen:
                continue
            # Of two parts one differs from the other as the other does from it.
            seen |= {events.tobytes(), (own & ~events).tobytes()}
            for component in range(parameters.values.shape[1]):
                yield _parameter(parameters, entity, component, replace(part, images=events))


def _parameter(
    parameters: SystemParameters, entity: int | None, component: int, part: _Part | None
) -> Alternative:
    family = parameters.family
    unit, factor = reported_unit(family, component)
    return Alternative(
        family.components[component],
        "" if entity is None else parameters.quantity(entity, component).entity,
        "all" if part is None else part.scope,
        "" if part is None else part.name,
        unit,
        factor,
        ParameterAlternative(family.name, entity, component, None if part is None else part.images),
    )


def _of_attitudes(material: _Material) -> Iterator[Alternative]:
    """The other north, where the meridians converge; ω and φ in the other order."""
    ins = next((item for item in material.observations.others if isinstance(item, InsAttitudes)), None)
    if ins is None:
        return
    given, image = material.given, material.block.image_of_event[ins.event]
    enu = given.local_from_enu[image]
    grid = np.swapaxes(enu, 1, 2) @ given.local_from_grid[image]
    convergence = np.arctan2(grid[:, 1, 0], grid[:, 0, 0])
    if np.abs(convergence).max(initial=0.0) > _NO_TURN:
        turned = np.einsum("nji,nj->ni", ins.observed, enu[:, :, 2]) * convergence[:, None]
        yield _of_itself("convergence", "", ObservationAlternative(ins.name, turned))
    # The orders differ by about ω φ in κ.
    read, other = given.local_from_body()[image], given.local_from_body("phi-omega-kappa")[image]
    turned = rotation.log(np.swapaxes(other, 1, 2) @ read)
    if np.abs(turned).max(initial=0.0) > _NO_TURN:
        order = _of_itself("angle_order", "", ObservationAlternative(ins.name, turned))
        yield replace(order, critical=_CRITICAL_OF_ORDER)


def _of_control(material: _Material) -> Iterator[Alternative]:
    """Shift, turn, scale and tilt of all control points; along east, north and up."""
    control = next((item for item in material.observations.others if isinstance(item, ControlPoints)), None)
    if control is None:
        return
    n = len(control.point)
    shifts = next((item for item in material.block.system if item.family.name == GNSS_SHIFT), None)
    # Held, the shift of the positions is tested itself, and is the same as one of the control.
    for axis, name in enumerate("xyz" if shifts is not None and shifts.free.any() else ""):
        shift = ObservationAlternative(control.name, along_axis(axis, np.ones(n)))
        yield Alternative(f"control_shift_{name}", "", "all", "", "m", 1.0, shift)
    place = material.block.object_point[control.point]
    frame = material.block.frame.local_from_enu(place[:1])[0]
    east, north, up = ((place - place.mean(axis=0)) @ frame).T
    height = material.block.frame.height(place)
    degrees = float(np.rad2deg(1.0))
    for name, axis, arm in (("control_tilt_east", 2, east), ("control_tilt_north", 2, north)):
        tilt = ObservationAlternative(control.name, along_axis(axis, arm))
        yield Alternative(name, "", "all", "", "deg", degrees, tilt)
    turn = ObservationAlternative(control.name, along_axis(0, north) - along_axis(1, east))
    yield Alternative("control_turn", "", "all", "", "deg", degrees, turn)
    yield scaled("control_scale", control.name, along_axis(0, east) + along_axis(1, north))
    if np.ptp(height) > _FLAT * np.ptp(up + np.hypot(east, north)):
        yield scaled("control_height_scale", control.name, along_axis(2, height - height.mean()))


def _of_itself(quantity: str, entity: str, model: ModelAlternative) -> Alternative:
    """Something that was corrected or read wrongly, as a part of itself."""
    least = LEAST_PART if quantity in WHOLE else 0.0
    return Alternative(quantity, entity, "all", "", "1", 1.0, model, least=least, most=_MOST_OF_ITSELF)


def _of_image_points(material: _Material, cameras: pd.DataFrame) -> Iterator[Alternative]:
    """Refraction; other readings of what is given; distortion and affinity of every camera."""
    block, rays = material.block, material.observations.image_points
    interior = next(item.values for item in block.system if item.family.name == INTERIOR_ORIENTATION)
    bent = refraction(block, rays, interior)
    if (np.abs(bent) * rays.inverse_sigma).max(initial=0.0) > _NO_REFRACTION:
        yield _of_itself("refraction", "", ObservationAlternative(rays.name, bent))
    for quantity, entity, change in other_readings(block, rays):
        yield _of_itself(quantity, entity, ObservationAlternative(rays.name, change))
    free = _free_additional(block)
    rows = {row["camera"]: row for row in cameras.to_dict("records")}
    for number, camera in enumerate(block.cameras):
        row = rows[camera.name]
        turn = int(str(row["calibration_axes_deg"]))
        chosen = additional_parameters(_IMAGE_ERRORS, image_format_of(row, turn), turn)
        changes = image_errors(rays, number, interior[number, 1:], chosen)
        for name, unit, error in zip(chosen.names, chosen.units, changes, strict=True):
            if name not in free:
                errors = ObservationAlternative(rays.name, error)
                yield Alternative(name, camera.name, "all", "", unit, 1.0, errors)


def _free_additional(block: Block) -> set[str]:
    """Names of the additional parameters that are estimated."""
    return {
        item.family.components[k]
        for item in block.system
        if item.family.name == ADDITIONAL_PARAMETERS
        for k in np.flatnonzero(item.free.any(axis=0))
    }
