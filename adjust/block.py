"""A block: its cameras, images and object points, and the approximate values of the unknowns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from adjust.arrays import Floats, Ints, as_indices, require_shape
from adjust.camera.interior import FrameCamera
from adjust.errors import InconsistentBlockError
from adjust.geometry.earth import LocalFrame
from adjust.geometry.rotation import are_rotations
from adjust.parameters import (
    BORESIGHT,
    FAMILIES,
    INTERIOR_ORIENTATION,
    ConsideredParameters,
    ParameterLayout,
    State,
    SystemParameters,
)
from adjust.rig import OF_HEADS, SYNCHRONISATION_OFFSET, Rig


@dataclass(frozen=True, eq=False, repr=False)
class Block:
    """A block to be adjusted, without its observations.

    Attributes
    ----------
    frame : the local Cartesian frame.
    cameras : the cameras; their mountings are fixed, their interior orientations are system parameters.
    images : names of the n images.
    camera_of_image : (n,) index into ``cameras``.
    flights, flight_of_image : names, and (n,) index into them.
    points : names of the m object points.
    system : the families of system parameters, with their values and which of them are free. Families that
        are not given are held fixed: the interior orientation at that of the cameras, the others at zero.
    projection_centre, local_from_camera, object_point : approximate values, see :class:`State`.
    considered : parameters held fixed whose errors are part of all covariances; None: they are exact.
    rig : which heads took the images of which event; None: every image is an event.
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
    rig: Rig | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "system", (*self.system, *self._held()))
        self._refuse_wrong_names()
        self._refuse_wrong_system()
        n, e, m = len(self.images), len(self.events), len(self.points)
        for kind, name in (("cameras", "camera_of_image"), ("flights", "flight_of_image")):
            index, count = as_indices(name, getattr(self, name), n), len(getattr(self, kind))
            if n and not count:
                raise InconsistentBlockError(f"The block has no {kind}; its images need at least one.")
            if n and not (index.min() >= 0 and index.max() < count):
                raise InconsistentBlockError(f"{name} has an index outside 0 … {count - 1}.")
            object.__setattr__(self, name, index)
        for name, shape in (
            ("projection_centre", (e, 3)),
            ("local_from_camera", (e, 3, 3)),
            ("object_point", (m, 3)),
        ):
            values = np.asarray(getattr(self, name), dtype=np.float64)
            require_shape(name, values.shape, shape)
            object.__setattr__(self, name, values)
        for name, values in (
            ("projection centres", self.projection_centre),
            ("rotations", self.local_from_camera),
            ("object points", self.object_point),
        ):
            if not np.isfinite(values).all():
                raise InconsistentBlockError(f"The approximate values of the {name} are not all finite.")
        self._refuse_other_matrices()
        free = {parameters.family.name: parameters.free for parameters in self.system}
        for place in () if self.considered is None else self.considered.places:
            if free[place.family][place.entity, place.component]:
                raise InconsistentBlockError(f"A parameter of {place.family} is both free and considered.")
        if self.rig is not None:
            self._refuse_wrong_rig(self.rig)

    def _refuse_wrong_names(self) -> None:
        """Names tell images, cameras and flights apart; those of object points when they are asked for."""
        for kind in ("images", "flights", "points"):
            object.__setattr__(self, kind, tuple(getattr(self, kind)))
        cameras = tuple(camera.name for camera in self.cameras)
        for what, names in (("images", self.images), ("flights", self.flights), ("cameras", cameras)):
            if len(set(names)) < len(names):
                twice = next(name for name in names if names.count(name) > 1)
                raise InconsistentBlockError(f"Two of the {what} have the name {twice!r}.")

    def _refuse_wrong_system(self) -> None:
        """Parameters of a camera or flight are found by its index, whatever the name of their entity."""
        owners = {"camera": tuple(camera.name for camera in self.cameras), "flight": self.flights}
        names = [given.family.name for given in self.system]
        for given in self.system:
            if names.count(given.family.name) > 1:
                raise InconsistentBlockError(f"The block has {given.family.name} twice.")
            expected = owners.get(given.family.entity_kind)
            if given.family.name in FAMILIES and expected is not None and tuple(given.entities) != expected:
                raise InconsistentBlockError(
                    f"{given.family.name} belongs to {', '.join(given.entities)}; expected: every "
                    f"{given.family.entity_kind} of the block, in its order: {', '.join(expected)}."
                )

    def _refuse_other_matrices(self) -> None:
        """Steps of the adjustment turn rotations, and would leave any other matrix what it is."""
        wrong = np.flatnonzero(~are_rotations(self.local_from_camera))
        if len(wrong):
            raise InconsistentBlockError(
                f"local_from_camera of {self.events[wrong[0]]} is not a rotation: its columns are the unit "
                "vectors of the camera axes x, y, z in the local frame, a right-handed system."
            )

    def _refuse_wrong_rig(self, rig: Rig) -> None:
        """Heads and events belong together, and the datum of the heads is fixed."""
        n, cameras = len(self.images), len(self.cameras)
        event = rig.event_of_image
        if event.shape != (n,) or not np.array_equal(np.unique(event), np.arange(len(rig.events))):
            raise InconsistentBlockError("Every image of a rig needs an event, and every event an image.")
        if not np.array_equal(rig.camera_of_image, self.camera_of_image) or rig.reference.shape != (cameras,):
            raise InconsistentBlockError("The heads of the rig are not the cameras of the block.")
        reference = rig.reference[self.camera_of_image]
        if np.any(reference != rig.camera_of_event[event]):
            raise InconsistentBlockError("The images of an event are from heads of different rigs.")
        taken = event * cameras + self.camera_of_image
        if len(np.unique(taken)) < n:
            raise InconsistentBlockError("An event contains two images of one head.")
        if np.any(self.flight_of_image != self.flight_of_event[event]):
            raise InconsistentBlockError("The images of an event are of different flights.")
        given = {parameters.family.name: parameters for parameters in self.system}
        if not all(family in given for family in OF_HEADS):
            raise InconsistentBlockError(
                "The block of a rig needs relative positions, rotations and synchronisation offsets of heads."
            )
        for parameters in (given[family] for family in OF_HEADS):
            held = rig.is_reference
            if np.any(parameters.free[held]) or np.any(parameters.values[held] != 0.0):
                raise InconsistentBlockError(
                    f"The {parameters.family.name} of a reference head is zero by definition and held fixed."
                )
        offset = given[SYNCHRONISATION_OFFSET]
        if rig.motion is None and (offset.free.any() or offset.values.any()):
            raise InconsistentBlockError("Synchronisation offsets of heads need the motion of the events.")

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
        return ParameterLayout(len(self.events), len(self.points), self.system)

    @property
    def events(self) -> tuple[str, ...]:
        """Names of the e events; without a rig those of the images."""
        return self.images if self.rig is None else self.rig.events

    @property
    def event_of_image(self) -> Ints:
        """(n,) event of every image."""
        return np.arange(len(self.images)) if self.rig is None else self.rig.event_of_image

    @property
    def image_of_event(self) -> Ints:
        """(e,) an image of every event: that of the reference head where it took one."""
        if self.rig is None:
            return np.arange(len(self.images))
        taken_by_reference = self.rig.is_reference[self.camera_of_image]
        order = np.lexsort((~taken_by_reference, self.rig.event_of_image))
        return order[np.searchsorted(self.rig.event_of_image[order], np.arange(len(self.events)))]

    @property
    def camera_of_event(self) -> Ints:
        """(e,) camera whose pose is the unknown one of each event: in a rig the reference head."""
        return self.camera_of_image if self.rig is None else self.rig.camera_of_event

    @property
    def flight_of_event(self) -> Ints:
        """(e,) flight of every event."""
        if self.rig is None:
            return self.flight_of_image
        found = np.zeros(len(self.events), dtype=np.int64)
        found[self.rig.event_of_image] = self.flight_of_image
        return found

    @property
    def body_from_camera(self) -> Floats:
        """Nominal mounting T of the camera of each event, (e, 3, 3)."""
        return np.stack([camera.body_from_camera for camera in self.cameras])[self.camera_of_event]

    def approximate_state(self) -> State:
        """The approximate values, and the given values of the system parameters."""
        system = {parameters.family.name: parameters.values for parameters in self.system}
        return State(
            self.projection_centre,
            self.local_from_camera,
            self.object_point,
            system,
            None if self.rig is None else self.rig.moving_by(system[BORESIGHT]),
        )
