"""The unknowns of a block and their place in the normal equations.

Unknowns come in three kinds: exterior orientations (six for each event: projection centre in local
axes, small rotation δ in the camera frame), object points (three each, eliminated first) and system
parameters (families such as boresight or lever arm, with one entity for each camera, flight or
strip), which form the dense border. What is held has column −1.

Of a camera alone every image is an event. The heads of a rig take the pictures of an event together; the
pose of the event is that of the reference head, see :mod:`adjust.rig`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from adjust.arrays import Bools, Floats, Ints, require_shape
from adjust.errors import InconsistentBlockError
from adjust.geometry import rotation
from adjust.rig import OF_HEADS, RELATIVE_POSITION, RELATIVE_ROTATION, SYNCHRONISATION_OFFSET, Pictures, Rig
from adjust.unknown_names import NamedValues

EXTERIOR_ORIENTATION = "exterior_orientation"
OBJECT_POINT = "object_point"
INTERIOR_ORIENTATION = "interior_orientation"
BORESIGHT = "boresight"
LEVER_ARM = "lever_arm"
GNSS_SHIFT = "gnss_shift"
GNSS_STRIP_BIAS = "gnss_strip_bias"
GNSS_DRIFT = "gnss_drift"
INS_STRIP_BIAS = "ins_strip_bias"
INS_DRIFT = "ins_drift"
TIME_OFFSET = "time_offset"
ADDITIONAL_PARAMETERS = "additional_parameters"

# What pictures may be off after the boresight has changed: far below any σ.
_SAME_PLACE_M, _SAME_ROTATION = 1e-6, 1e-9

EntityKind = Literal["camera", "flight", "strip"]
#: Unknowns whose approximate values carry the datum of a free network.
InnerConstraints: TypeAlias = Literal["object_points", "projection_centres", "both"]
Unit = Literal["m", "rad", "s", "m/s", "rad/s", "1"]


@dataclass(frozen=True)
class Family:
    """A family of system parameters that always come together.

    Attributes
    ----------
    name : of the family.
    components : the names of its parameters, as they are reported.
    entity_kind : what has its own set of them.
    unit : SI unit of its parameters; of additional parameters, whose sets are published with units of their
        own, each has its own in ``own_units``.
    always_there : whether a block has them even where none is free; else nothing is known of them before.
    """

    name: str
    components: tuple[str, ...]
    entity_kind: EntityKind
    unit: Unit
    own_units: tuple[str, ...] = ()
    always_there: bool = True

    def unit_of(self, component: int) -> str:
        """Unit of one parameter."""
        return self.own_units[component] if self.own_units else self.unit


FAMILIES: Mapping[str, Family] = {
    family.name: family
    for family in (
        Family(
            INTERIOR_ORIENTATION, ("focal_length", "principal_point_x", "principal_point_y"), "camera", "m"
        ),
        Family(BORESIGHT, ("boresight_roll", "boresight_pitch", "boresight_yaw"), "camera", "rad"),
        Family(LEVER_ARM, ("lever_arm_x", "lever_arm_y", "lever_arm_z"), "camera", "m"),
        Family(GNSS_SHIFT, ("gnss_shift_x", "gnss_shift_y", "gnss_shift_z"), "flight", "m"),
        Family(
            GNSS_STRIP_BIAS,
            ("gnss_strip_bias_x", "gnss_strip_bias_y", "gnss_strip_bias_z"),
            "strip",
            "m",
            always_there=False,
        ),
        Family(
            GNSS_DRIFT,
            ("gnss_drift_x", "gnss_drift_y", "gnss_drift_z"),
            "strip",
            "m/s",
            always_there=False,
        ),
        Family(
            INS_STRIP_BIAS,
            ("ins_strip_bias_roll", "ins_strip_bias_pitch", "ins_strip_bias_yaw"),
            "strip",
            "rad",
            always_there=False,
        ),
        Family(
            INS_DRIFT,
            ("ins_drift_roll", "ins_drift_pitch", "ins_drift_yaw"),
            "strip",
            "rad/s",
            always_there=False,
        ),
        Family(TIME_OFFSET, ("time_offset",), "flight", "s", always_there=False),
        Family(
            RELATIVE_POSITION,
            ("relative_position_x", "relative_position_y", "relative_position_z"),
            "camera",
            "m",
            always_there=False,
        ),
        Family(
            RELATIVE_ROTATION,
            ("relative_rotation_roll", "relative_rotation_pitch", "relative_rotation_yaw"),
            "camera",
            "rad",
            always_there=False,
        ),
        Family(SYNCHRONISATION_OFFSET, (SYNCHRONISATION_OFFSET,), "camera", "s", always_there=False),
    )
}


def additional_family(components: tuple[str, ...], units: tuple[str, ...]) -> Family:
    """The family of additional parameters: names ``SET:NAME`` with the unit each is published in.

    Its entities are cameras, or cameras in one flight.
    """
    return Family(ADDITIONAL_PARAMETERS, components, "camera", "1", units)


@dataclass(frozen=True)
class Quantity:
    """One system parameter of a block: what it is, and what has it. Its texts are made here and never read.

    Attributes
    ----------
    name : of the component, e.g. ``boresight_roll``.
    camera, flight, strip : what has it, None where it is of none; of a camera and a flight: it applies to the
        camera in this flight alone. A flight without a name is empty.
    """

    name: str
    camera: str | None = None
    flight: str | None = None
    strip: str | None = None

    @property
    def entity(self) -> str:
        """What has it, for people and as key of tables: a camera, ``CAMERA in FLIGHT``, a flight, a strip."""
        if self.camera is not None and self.flight is not None:
            return f"{self.camera} in {self.flight or 'the flight'}"
        return next((name for name in (self.camera, self.flight, self.strip) if name is not None), "")

    def __str__(self) -> str:
        return f"{self.name} of {self.entity}"


@dataclass(frozen=True, eq=False)
class SystemParameters:
    """The parameters of one family: their values for every entity, and which are free.

    Attributes
    ----------
    family : the family.
    entities : names of the e cameras, flights or strips.
    values : (e, d) given values, SI and radians, or the family's own units.
    free : (e, d) true where the parameter is unknown; elsewhere it keeps its value.
    flights : of cameras that have a set for each flight, the flights of the e sets; None: one set each.

    Raises
    ------
    InconsistentBlockError : of arrays of another shape, or values that are not finite.
    """

    family: Family
    entities: tuple[str, ...]
    values: Floats
    free: Bools
    flights: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.family, Family):
            raise InconsistentBlockError(
                f"The family of system parameters is {self.family!r}, not a Family such as "
                f"FAMILIES[{INTERIOR_ORIENTATION!r}]."
            )
        name, shape = self.family.name, (len(self.entities), len(self.family.components))
        require_shape(f"The array of values of {name}", np.shape(self.values), shape)
        require_shape(f"The array of free parameters of {name}", np.shape(self.free), shape)
        object.__setattr__(self, "values", np.asarray(self.values, dtype=np.float64))
        object.__setattr__(self, "free", np.asarray(self.free, dtype=np.bool_))
        if not np.isfinite(self.values).all():
            raise InconsistentBlockError(f"The values of {name} are not all finite.")

    def quantity(self, entity: int, component: int) -> Quantity:
        """One of the parameters by its name and what has it."""
        owner = {self.family.entity_kind: self.entities[entity]}
        if self.flights is not None:
            owner["flight"] = self.flights[entity]
        return Quantity(self.family.components[component], **owner)


class ParameterPlace(NamedTuple):
    """Where one system parameter stands: name of its family, entity and component, indices in it."""

    family: str
    entity: int
    component: int


@dataclass(frozen=True, eq=False)
class ConsideredParameters:
    """System parameters held fixed at values with a known covariance matrix.

    They are not unknowns, and their errors are part of what is said about everything else (Schmidt 1966).

    Attributes
    ----------
    places : the k parameters.
    covariance : (k, k) of their values, SI and radians, or the family's own units; no σ0 scales it.
    """

    places: tuple[ParameterPlace, ...]
    covariance: Floats

    @cached_property
    def root(self) -> Floats:
        """(k, k) R with R Rᵀ = C: what k independent errors of unit variance change."""
        sigma = np.sqrt(np.diagonal(self.covariance))
        scale = np.where(sigma > 0.0, sigma, 1.0)
        values, vectors = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


@dataclass(frozen=True, eq=False)
class State:
    """Values of all unknowns, and of what is held, at one moment of the iteration.

    Attributes
    ----------
    projection_centre : (e, 3) metres, local frame, of every event.
    local_from_camera : (e, 3, 3) of the camera, in a rig of its reference head.
    object_point : (m, 3) metres, local frame.
    system : family name → (entities, components), SI and radians.
    rig : which heads took the pictures; None: every image is an event.
    """

    projection_centre: Floats
    local_from_camera: Floats
    object_point: Floats
    system: Mapping[str, Floats]
    rig: Rig | None = None

    def __post_init__(self) -> None:
        # Every other layout in memory would have the kernels compiled again.
        for name in ("projection_centre", "local_from_camera", "object_point"):
            object.__setattr__(self, name, _as_kernels_take_it(getattr(self, name)))
        system = {family: _as_kernels_take_it(values) for family, values in self.system.items()}
        object.__setattr__(self, "system", NamedValues(system))

    @cached_property
    def pictures(self) -> Pictures:
        """The poses of the pictures."""
        if self.rig is None:
            return Pictures(self.projection_centre, self.local_from_camera, None)
        return self.rig.pictures(
            self.projection_centre, self.local_from_camera, self.system, self.system[BORESIGHT]
        )

    def with_own_motion(self) -> tuple[State, bool]:
        """Pictures of late heads moved as with the boresight of this state, and whether they are the same."""
        if self.rig is None or not np.any(self.system[SYNCHRONISATION_OFFSET]):
            return self, True
        found = replace(self, rig=self.rig.moving_by(self.system[BORESIGHT]))
        moved = np.abs(found.pictures.projection_centre - self.pictures.projection_centre).max()
        turned = np.abs(found.pictures.local_from_camera - self.pictures.local_from_camera).max()
        return found, bool(moved <= _SAME_PLACE_M and turned <= _SAME_ROTATION)


def _as_kernels_take_it(values: Floats) -> Floats:
    """The same array, or a copy where it is read-only or not in the order of C."""
    return np.require(values, dtype=np.float64, requirements=["C", "W"])


def free_in_rig(rig: Rig, family: str, chosen: Bools) -> Bools:
    """Those of the chosen parameters (c, d) of the cameras of a rig that are unknowns.

    A reference head has no mounting relative to itself; boresight and lever arm of the other heads follow
    from its own; a platform that takes no pictures has no interior orientation.
    """
    owners = np.ones(len(rig.reference), dtype=bool)
    if family in OF_HEADS:
        owners = ~rig.is_reference
    elif family in (BORESIGHT, LEVER_ARM):
        owners = rig.is_reference
    elif family == INTERIOR_ORIENTATION:
        owners = np.isin(np.arange(len(owners)), rig.camera_of_image)
    return np.asarray(chosen & owners[:, None])


@dataclass(frozen=True, eq=False)
class ParameterLayout:
    """How many events and object points there are, and the column each system parameter has; −1: held."""

    events: int
    points: int
    system: tuple[SystemParameters, ...]
    columns: Mapping[str, Ints] = field(init=False)
    border: int = field(init=False)

    def __post_init__(self) -> None:
        columns: dict[str, Ints] = {}
        following = 0
        for parameters in self.system:
            index = np.full(parameters.free.shape, -1, dtype=np.int64)
            count = int(parameters.free.sum())
            index[parameters.free] = np.arange(following, following + count)
            columns[parameters.family.name] = index
            following += count
        object.__setattr__(self, "columns", columns)
        object.__setattr__(self, "border", following)

    @property
    def unknowns(self) -> int:
        """Number of unknowns u."""
        return 6 * self.events + 3 * self.points + self.border

    @property
    def border_quantities(self) -> tuple[Quantity, ...]:
        """The parameter of every column of the border."""
        return tuple(
            parameters.quantity(int(entity), int(component))
            for parameters in self.system
            for entity, component in np.argwhere(parameters.free)
        )

    def border_names(self) -> tuple[tuple[str, str, str], ...]:
        """(parameter, entity, unit) of every column of the border."""
        units = (
            parameters.family.unit_of(int(component))
            for parameters in self.system
            for _, component in np.argwhere(parameters.free)
        )
        return tuple(
            (of.name, of.entity, unit) for of, unit in zip(self.border_quantities, units, strict=True)
        )

    def update(self, state: State, of_exposures: Floats, of_border: Floats, of_points: Floats) -> State:
        """Values after adding (n, 6), (g,) and (m, 3) increments; rotations by R ← R · exp(δ)."""
        system = dict(state.system)
        for name, columns in self.columns.items():
            free = columns >= 0
            if free.any():
                values = system[name].copy()
                values[free] += of_border[columns[free]]
                system[name] = values
        return replace(
            state,
            projection_centre=state.projection_centre + of_exposures[:, :3],
            local_from_camera=state.local_from_camera @ rotation.exp(of_exposures[:, 3:]),
            object_point=state.object_point + of_points,
            system=system,
        )
