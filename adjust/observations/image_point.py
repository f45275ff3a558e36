"""Image points: measured image coordinates of object points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from adjust.arrays import Bools, Floats, Ints, as_indices, as_sigmas, order_of_numbers, require_shape
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.errors import InconsistentBlockError
from adjust.observations import image_point_kernel
from adjust.observations.base import Linearization, StochasticModel, Term
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    EXTERIOR_ORIENTATION,
    INTERIOR_ORIENTATION,
    OBJECT_POINT,
    State,
    Unit,
)
from adjust.rig import OF_HEADS
from adjust.unknown_names import indices_of

if TYPE_CHECKING:
    from adjust.block import Block

_MOST_BYTES_OF_BASIS = 2**28


@dataclass(frozen=True, eq=False)
class IdealRays:
    """Some image points, corrected by additional parameters.

    Attributes
    ----------
    xy : (r, 2) measured + Δ − D, metres, image system; of straight rays the ideal point.
    basis : (r, 2, t) derivatives of Δ − D by t additional parameters.
    slope : (r, 2, 5) ∂Δ/∂(x̄, ȳ), ∂d/∂u and d side by side; (1, 2, 5) zeros where they are not needed or there
        are none.
    """

    xy: Floats
    basis: Floats
    slope: Floats

    def __post_init__(self) -> None:
        # Kernels are compiled anew for every layout of their arrays in memory.
        object.__setattr__(self, "basis", np.ascontiguousarray(self.basis))


@dataclass(frozen=True, eq=False)
class KnownBasis:
    """What the additional parameters do at every measured point, which stays where the principal point does.

    Attributes
    ----------
    basis : (n, 2, d) derivatives of Δ by all d components of the family; Δ is linear in them.
    principal_point : (cameras, 2) metres, for which it is known.
    """

    basis: Floats
    principal_point: Floats

    def correction(self, part: slice, entity: Ints | None, values: Floats) -> Floats:
        """Δ (r, 2) at some image points of parameter values (e, d); entity (r,), None where there is one."""
        basis = self.basis[part]
        if not np.any(values):
            return np.zeros(basis.shape[:2])
        if entity is None:
            return np.asarray((basis.reshape(-1, basis.shape[2]) @ values[0]).reshape(-1, 2))
        return np.asarray(np.einsum("rck,rk->rc", basis, values[entity]))


@dataclass(frozen=True, eq=False)
class ImagePoints:
    """Image coordinates, sorted by object point.

    The observation is zero when the ray through the measured point meets the object point:

        x̄ + Δ = c (u + d),    u = −(p1, p2)/p3,    p = R_cᵀ (X − X0)

    with x̄ = (x − x0, y − y0), the correction Δ(x̄) of the additional parameters and the distortion d(u) of
    those among them that are forward sets; D = c d.

    Attributes
    ----------
    image, point : (n,) indices; point is ascending.
    camera_of_image : index of the camera of every image of the block.
    xy : (n, 2) metres, image system.
    sigma : (n, 2) metres.
    active : (n,) false for rejected observations.
    self_calibration : the additional parameters of every image; None where there are none.
    offset : (n, 2) metres, added to the image points whatever Δ is; None for nothing.
    known : the basis of the additional parameters, see ``with_known_basis``; None: it is computed each time.
    event_of_image : of a rig, the event of every image of the block; None: every image is an event.
    """

    image: Ints
    point: Ints
    camera_of_image: Ints
    xy: Floats
    sigma: Floats
    active: Bools
    self_calibration: SelfCalibration | None = None
    offset: Floats | None = None
    known: KnownBasis | None = None
    event_of_image: Ints | None = None

    name: ClassVar[str] = "image_points"
    components: ClassVar[tuple[str, ...]] = ("x", "y")
    unit: ClassVar[Unit] = "m"

    def __post_init__(self) -> None:
        n = len(self.xy)
        for name, count in (("image", n), ("point", n), ("camera_of_image", len(self.camera_of_image))):
            object.__setattr__(self, name, as_indices(f"{self.name}: {name}", getattr(self, name), count))
        for name, kind, shape in (("xy", float, (n, 2)), ("sigma", float, (n, 2)), ("active", bool, (n,))):
            values = np.asarray(getattr(self, name), dtype=kind)
            require_shape(f"{self.name}: {name}", values.shape, shape)
            object.__setattr__(self, name, values)
        if np.any(np.diff(self.point) < 0):
            raise InconsistentBlockError("Image points must be sorted by object point.")
        if not (np.all(self.sigma > 0.0) and np.isfinite(self.sigma).all() and np.isfinite(self.xy).all()):
            raise InconsistentBlockError(
                "Image coordinates and their sigmas must be finite, sigmas positive."
            )

    @classmethod
    def measured(
        cls,
        block: Block,
        image: ArrayLike,
        point: ArrayLike,
        xy: ArrayLike,
        sigma: ArrayLike,
        self_calibration: SelfCalibration | None = None,
    ) -> Self:
        """Image points of a block, in any order.

        They, and therefore their residuals, are sorted by object point: row k is that of
        ``numpy.argsort(point, kind="stable")[k]`` with indices of the object points.

        Parameters
        ----------
        image, point : (n,) names, or indices, of the images and object points of the block.
        xy : (n, 2) metres, image system.
        sigma : metres; a number, or an array that broadcasts to (n, 2).
        self_calibration : additional parameters of the cameras, which the block has, too.

        Raises
        ------
        InconsistentBlockError : of other shapes or values.
        UnknownNameError : the block has no such image or object point.
        """
        measured = np.asarray(xy, dtype=np.float64)
        of_image = indices_of("image", image, block.images)
        of_point = indices_of("object point", point, block.points)
        require_shape("The array of images", of_image.shape, of_point.shape)
        require_shape("The array of image coordinates", measured.shape, (len(of_point), 2))
        order = order_of_numbers(of_point)
        return cls(
            of_image[order],
            of_point[order],
            block.camera_of_image,
            measured[order],
            as_sigmas(sigma, measured.shape)[order],
            np.ones(len(order), dtype=bool),
            self_calibration,
            event_of_image=None if block.rig is None else block.rig.event_of_image,
        )

    @cached_property
    def event(self) -> Ints:
        """(n,) index of the event whose pose each image point touches."""
        return self.image if self.event_of_image is None else self.event_of_image[self.image]

    @cached_property
    def inverse_sigma(self) -> Floats:
        """(n, 2) 1/σ, zero for rejected observations."""
        inverse = 1.0 / self.sigma
        inverse[~self.active] = 0.0
        return inverse

    @cached_property
    def stochastic(self) -> StochasticModel:
        """The weights in the general form (the kernels use ``inverse_sigma``)."""
        whitener = np.zeros((len(self.image), 2, 2))
        whitener[:, 0, 0], whitener[:, 1, 1] = self.inverse_sigma[:, 0], self.inverse_sigma[:, 1]
        return StochasticModel(whitener, np.repeat(self.active[:, None], 2, axis=1), self.sigma)

    def ideal(
        self, state: State, components: Ints, with_slope: bool, first: int = 0, last: int | None = None
    ) -> IdealRays:
        """The image points first … last − 1, corrected by the additional parameters of a state.

        The distortion D is that of the point where the state projects the object point to.

        Parameters
        ----------
        components : (t,) the additional parameters whose basis is wanted.
        with_slope : whether ∂Δ/∂(x̄, ȳ) is wanted.
        """
        last = len(self.image) if last is None else last
        corrected = self._corrected(state, components, with_slope, slice(first, last))
        if self.self_calibration is None or self.self_calibration.forward is None:
            return corrected
        direction = image_point_kernel.directions(
            self.image,
            self.point,
            first,
            last,
            state.pictures.projection_centre,
            state.pictures.local_from_camera,
            state.object_point,
        )
        distorted, d, c = self._distorted(state, components, corrected, direction, slice(first, last))
        return replace(distorted, xy=corrected.xy - c * d)

    def with_known_basis(self, state: State) -> Self:
        """The same with the basis of the additional parameters computed once, where that is the same.

        It is as long as the principal point of a state stays and Δ is linear in the parameters. Not above
        256 MiB.
        """
        model = self.self_calibration
        if model is None or not model.is_linear:
            return self
        if 16 * len(model.names) * len(self.image) > _MOST_BYTES_OF_BASIS:
            return self
        principal_point = state.system[INTERIOR_ORIENTATION][:, 1:].copy()
        if self.known is not None and np.array_equal(self.known.principal_point, principal_point):
            return self
        reduced = self.xy - principal_point[self.camera_of_image[self.image]]
        values = np.zeros_like(state.system[ADDITIONAL_PARAMETERS])
        _, basis = model.evaluate(self.image, reduced, values, np.arange(len(model.names)))
        return replace(self, known=KnownBasis(np.ascontiguousarray(basis), principal_point))

    def straight(self, state: State, components: Ints) -> IdealRays:
        """All image points made ideal with the additional parameters of a state, without object points.

        Basis and slopes are those of ``ideal`` there.
        """
        everything = slice(0, len(self.image))
        corrected = self._corrected(state, components, True, everything)
        if self.self_calibration is None or self.self_calibration.forward is None:
            return corrected
        interior = state.system[INTERIOR_ORIENTATION][self.camera_of_image[self.image]]
        values = state.system[ADDITIONAL_PARAMETERS]
        direction = self.self_calibration.forward.undistorted(
            self.image, (corrected.xy - interior[:, 1:]) / interior[:, :1], values
        )
        distorted, _, c = self._distorted(state, components, corrected, direction, everything)
        return replace(distorted, xy=interior[:, 1:] + c * direction)

    def _corrected(self, state: State, components: Ints, with_slope: bool, part: slice) -> IdealRays:
        """Some image points with Δ and its derivatives, without any distortion."""
        xy, image = self.xy[part], self.image[part]
        no_slope = np.zeros((1, 2, 5))
        shifted = xy if self.offset is None else xy + self.offset[part]
        model = self.self_calibration
        if model is None:
            return IdealRays(shifted, np.zeros((len(xy), 2, 0)), no_slope)
        values = state.system[ADDITIONAL_PARAMETERS]
        principal_point = state.system[INTERIOR_ORIENTATION][:, 1:]
        if self.known is not None and np.array_equal(self.known.principal_point, principal_point):
            entity = None if len(values) == 1 else model.entity_of_image[image]
            correction = self.known.correction(part, entity, values)
            everything = len(components) == self.known.basis.shape[2]
            basis = self.known.basis[part] if everything else self.known.basis[part][:, :, components]
        else:
            reduced = xy - principal_point[self.camera_of_image[image]]
            correction, basis = model.evaluate(image, reduced, values, components)
        if not (with_slope and np.any(values)):
            return IdealRays(shifted + correction, basis, no_slope)
        slope = np.zeros((len(xy), 2, 5))
        slope[:, :, :2] = model.slope(image, xy - principal_point[self.camera_of_image[image]], values)
        return IdealRays(shifted + correction, basis, slope)

    def _distorted(
        self, state: State, components: Ints, corrected: IdealRays, direction: Floats, part: slice
    ) -> tuple[IdealRays, Floats, Floats]:
        """The rays with the derivatives of the distortion at directions u (r, 2); d (r, 2); and c (r, 1)."""
        assert self.self_calibration is not None
        model = self.self_calibration.forward
        assert model is not None
        image, values = self.image[part], state.system[ADDITIONAL_PARAMETERS]
        c = state.system[INTERIOR_ORIENTATION][self.camera_of_image[image], :1]
        d, basis = model.evaluate(image, direction, values, components)
        slope = np.empty((len(image), 2, 5))
        slope[:, :, :2] = corrected.slope[:, :, :2]
        slope[:, :, 2:4], slope[:, :, 4] = model.slope(image, direction, values), d
        return IdealRays(corrected.xy, corrected.basis - c[:, :, None] * basis, slope), d, c

    def linearize(self, state: State) -> Linearization:
        """Observation equations at a state, not whitened; derivatives exact."""
        n = len(self.image)
        names = () if self.self_calibration is None else self.self_calibration.names
        ideal = self.ideal(state, np.arange(len(names)), with_slope=True)
        misclosure, of_exterior = np.empty((n, 2)), np.empty((n, 2, 6))
        last = 3 + len(names)
        of_system = np.empty((n, 2, last if state.rig is None else last + 7))
        of_point = np.empty((n, 2, 3))
        image_point_kernel.linearize_all(
            self.image,
            self.point,
            self.camera_of_image,
            state.pictures.projection_centre,
            state.pictures.local_from_camera,
            state.pictures.of_event,
            state.object_point,
            state.system[INTERIOR_ORIENTATION],
            ideal.xy,
            ideal.slope,
            ideal.basis,
            np.ones((n, 2)),
            misclosure,
            of_exterior,
            of_system,
            of_point,
        )
        terms = [
            Term(EXTERIOR_ORIENTATION, self.event, of_exterior),
            Term(OBJECT_POINT, self.point, of_point),
            Term(INTERIOR_ORIENTATION, self.camera_of_image[self.image], of_system[:, :, :3]),
        ]
        if self.self_calibration is not None:
            entity = self.self_calibration.entity_of_image[self.image]
            terms.append(Term(ADDITIONAL_PARAMETERS, entity, of_system[:, :, 3:last]))
        if state.rig is not None:
            head = self.camera_of_image[self.image]
            of_heads = np.split(of_system[:, :, last:], (3, 6), axis=2)
            terms += [Term(family, head, part) for family, part in zip(OF_HEADS, of_heads, strict=True)]
        return Linearization(misclosure, tuple(terms))

    def seen_from(self, chosen: Bools, points: int) -> Floats:
        """From how many places each object point (points,) is seen by some of the rays (n,).

        A ray is a place of its own; those of several heads of one event are one place together.
        """
        if self.event_of_image is None:
            return np.asarray(np.bincount(self.point, weights=chosen, minlength=points), np.float64)
        pairs = np.unique(np.stack([self.point[chosen], self.event[chosen]]), axis=1)
        return np.bincount(pairs[0], minlength=points).astype(np.float64)

    def misclosure(self, state: State, first: int = 0, last: int | None = None) -> Floats:
        """Observed − computed (r, 2) of the image points first … last − 1, metres.

        NaN where the object point lies behind the camera.
        """
        result: Floats = image_point_kernel.misclosures(
            self.image[first:last],
            self.point[first:last],
            self.camera_of_image,
            state.pictures.projection_centre,
            state.pictures.local_from_camera,
            state.object_point,
            state.system[INTERIOR_ORIENTATION],
            self.ideal(state, np.zeros(0, dtype=np.int64), False, first, last).xy,
        )
        return result

    def only(self, rows: Ints | slice, point: Ints | None = None) -> Self:
        """Some of the image points, by ascending rows; in any order with object points numbered anew (n,).

        A range of rows copies nothing.
        """
        return replace(
            self,
            image=self.image[rows],
            point=self.point[rows] if point is None else point,
            xy=self.xy[rows],
            sigma=self.sigma[rows],
            active=self.active[rows],
            offset=None if self.offset is None else self.offset[rows],
            known=None if self.known is None else replace(self.known, basis=self.known.basis[rows]),
        )

    def without(self, rejected: Bools) -> Self:
        """The same group with the image points (n,) that are rejected taken out; itself if none is."""
        left = self.active & ~rejected
        return self if np.array_equal(left, self.active) else replace(self, active=left)

    def rescaled(self, factor: Floats) -> Self:
        """The same group with its standard deviations multiplied by factors that broadcast to (n, 2)."""
        return replace(self, sigma=self.sigma * factor)
