"""A block: its cameras, images and object points, and the approximate values of the unknowns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints
from adjust.camera.interior import FrameCamera
from adjust.errors import InconsistentBlockError
from adjust.geometry.earth import LocalFrame
from adjust.parameters import (
    FAMILIES,
    INTERIOR_ORIENTATION,
    ConsideredParameters,
    ParameterLayout,
    State,
    SystemParameters,
)


@dataclass(frozen=True, eq=False, repr=False)
class Block:
    """What is to be adjusted, without its observations.

    Attributes
    ----------
    frame : the local Cartesian frame.
    cameras : the cameras; their mountings are fixed, their interior orientation is a family.
    images : names of the n images.
    camera_of_image : (n,) index into ``cameras``.
    flights, flight_of_image : names, and (n,) index into them.
    points : names of the m object points.
    system : the families of system parameters with given values and freedom. Those that every block has and
        that are not given are held: the interior orientation as its cameras state it, the others at zero.
    projection_centre, local_from_camera, object_point : approximate values, see :class:`State`.
    considered : held system parameters whose errors are part of all covariances; None: what is held is exact.
    """

    frame: LocalFrame
    cameras: tuple[FrameCamera, ...]
    images: tuple[str, ...]
    camera_of_image: Ints
    flights: tuple[str, ...]
    flight_of_image: Ints
    points: tuple[str, ...]
    system: tuple[SystemParameters, ...]
    projection_centre: Floats
    local_from_camera: Floats
    object_point: Floats
    considered: ConsideredParameters | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "system", (*self.system, *self._held()))
        n, m = len(self.images), len(self.points)
        shapes = {
            "camera_of_image": (self.camera_of_image.shape, (n,)),
            "flight_of_image": (self.flight_of_image.shape, (n,)),
            "projection_centre": (self.projection_centre.shape, (n, 3)),
            "local_from_camera": (self.local_from_camera.shape, (n, 3, 3)),
            "object_point": (self.object_point.shape, (m, 3)),
        }
        for name, (found, expected) in shapes.items():
            if found != expected:
                raise InconsistentBlockError(f"{name} has the shape {found}; {expected} is needed.")
        for name, values in (
            ("projection centres", self.projection_centre),
            ("rotations", self.local_from_camera),
            ("object points", self.object_point),
        ):
            if not np.isfinite(values).all():
                raise InconsistentBlockError(f"The approximate values of the {name} are not all finite.")
        free = {parameters.family.name: parameters.free for parameters in self.system}
        for place in () if self.considered is None else self.considered.places:
            if free[place.family][place.entity, place.component]:
                raise InconsistentBlockError(f"A parameter of {place.family} is free and considered, too.")

    def _held(self) -> Iterator[SystemParameters]:
        """The families that are always there and were not given."""
        given = {parameters.family.name for parameters in self.system}
        entities = {"camera": tuple(camera.name for camera in self.cameras), "flight": self.flights}
        for name, family in FAMILIES.items():
            if family.always_there and name not in given:
                owners = entities[family.entity_kind]
                values = np.zeros((len(owners), len(family.components)))
                if name == INTERIOR_ORIENTATION:
                    values[:] = [(camera.focal_length, *camera.principal_point) for camera in self.cameras]
                yield SystemParameters(family, owners, values, np.zeros(values.shape, dtype=bool))

    def __repr__(self) -> str:
        free = sorted(parameters.family.name for parameters in self.system if parameters.free.any())
        cameras = ", ".join(camera.name for camera in self.cameras)
        return (
            f"<Block: {len(self.images):,} images of {cameras}, {len(self.points):,} object points; "
            f"{'free: ' + ', '.join(free) if free else 'all families held'}>"
        )

    @property
    def layout(self) -> ParameterLayout:
        """The place of every unknown in the normal equations."""
        return ParameterLayout(len(self.images), len(self.points), self.system)

    @property
    def body_from_camera(self) -> Floats:
        """Nominal mounting T of the camera of each image, (n, 3, 3)."""
        return np.stack([camera.body_from_camera for camera in self.cameras])[self.camera_of_image]

    def approximate_state(self) -> State:
        """The approximate values, and the given values of the system parameters."""
        return State(
            self.projection_centre,
            self.local_from_camera,
            self.object_point,
            {parameters.family.name: parameters.values for parameters in self.system},
        )
