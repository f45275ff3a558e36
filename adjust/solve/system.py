"""What stays the same over the iterations of an adjustment: unknowns, observations, sparsity."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.block import Block
from adjust.errors import InconsistentBlockError
from adjust.observations.base import JoinsPoints, ObservationGroup
from adjust.observations.image_point import IdealRays, ImagePoints
from adjust.parameters import INTERIOR_ORIENTATION, InnerConstraints, ParameterLayout, State
from adjust.solve.consistency import refuse_other_calibration, refuse_others_than
from adjust.solve.covisibility import Covisibility, covisibility, point_starts
from adjust.solve.fronts import HelmertBlocking
from adjust.solve.joined_points import joined_points
from adjust.solve.lanes import Lane
from adjust.solve.open_platforms import refuse_open_platforms
from adjust.solve.ray_columns import RayColumns, ray_columns


@dataclass(frozen=True, eq=False)
class Observations:
    """All observations of a block: the image points, and every other group."""

    image_points: ImagePoints
    others: tuple[ObservationGroup, ...]

    def __post_init__(self) -> None:
        if not isinstance(self.others, (tuple, list)):
            raise InconsistentBlockError("The other observations must be a tuple of groups.")
        object.__setattr__(self, "others", tuple(self.others))

    @property
    def groups(self) -> tuple[ObservationGroup, ...]:
        """All groups, image points first."""
        return (self.image_points, *self.others)

    @property
    def count(self) -> int:
        """Number n of scalar observations that take part."""
        of_rays = 2 * int(np.count_nonzero(self.image_points.active))
        return of_rays + sum(int(group.stochastic.present.sum()) for group in self.others)


@dataclass(frozen=True, eq=False)
class System:
    """What stays the same over the iterations: unknowns, observations, sparsity.

    Attributes
    ----------
    observations : those that take part; what belongs to an object point that is no unknown is taken out.
    active_point : (m,) object points that are unknown; the others have lost too many rays.
    joined : the object points (k,) and (k,) that observations join.
    point_start : (m + 1,) where the rays of each point begin.
    threads : how many may work at once; never changes a result.
    inner_constraints : unknowns whose approximate values carry what the observations leave open of the
        datum; None: an open datum is an error.
    """

    block: Block
    layout: ParameterLayout
    observations: Observations
    blocking: HelmertBlocking
    point_start: Ints
    active_point: Bools
    joined: tuple[Ints, Ints]
    threads: int = 1
    inner_constraints: InnerConstraints | None = None

    @classmethod
    def of(
        cls,
        block: Block,
        observations: Observations,
        threads: int = 1,
        inner_constraints: InnerConstraints | None = None,
    ) -> System:
        """Symbolic analysis of a block and its observations.

        Raises
        ------
        InconsistentBlockError : if an observation belongs to something that is not there, or image points are
            given in another unit or for other cameras.
        DatumDefectError : if the rotation of a platform without pictures is not determined.
        """
        refuse_others_than(block, observations)
        refuse_open_platforms(block, observations)
        observations = with_known_basis(block, observations)
        events, points = len(block.events), len(block.points)
        active = determined_points(block, observations)
        pattern = covisibility(observations.image_points, events, points)
        return cls(
            block,
            block.layout,
            _of_active_points(observations, active),
            HelmertBlocking.of(
                pattern.with_pairs(*_correlated_events(observations)), block.projection_centre
            ),
            point_starts(observations.image_points.point, points),
            active,
            joined_points(observations.groups),
            threads,
            inner_constraints,
        )

    def remaining(self, observations: Observations) -> System:
        """The same system after some of its observations have been rejected."""
        active_point = determined_points(self.block, observations)
        # Correlation over time joins what stood on either side of a rejected observation.
        pattern = self.pattern.with_pairs(*_correlated_events(observations))
        return replace(
            self,
            observations=_of_active_points(observations, active_point),
            active_point=active_point,
            blocking=self.blocking
            if pattern is self.pattern
            else HelmertBlocking.of(pattern, self.block.projection_centre),
        )

    @property
    def pattern(self) -> Covisibility:
        """Which exposure blocks there are."""
        return self.blocking.pattern

    @property
    def border(self) -> int:
        """Columns of the border: the system parameters, and behind them the unknown of each join."""
        return self.layout.border + len(self.joined[0])

    @cached_property
    def ray_columns(self) -> RayColumns:
        """Where the system parameters that image points touch stand in the border."""
        return ray_columns(self.layout, self.observations.image_points)

    @property
    def touched_columns(self) -> Ints:
        """Columns of the border that the elimination of object points touches."""
        return np.concatenate([self.ray_columns.border, np.arange(self.layout.border, self.border)])

    def ideal_rays(self, state: State, lane: Lane) -> IdealRays:
        """The image points of the object points of a lane, corrected by the additional parameters."""
        first, last = (int(self.point_start[index]) for index in lane)
        columns = self.ray_columns
        rays = self.observations.image_points
        return rays.ideal(state, columns.components, columns.principal_point_is_free, first, last)

    def rays_of_lane(self, state: State, lane: Lane) -> tuple[Floats | Ints | Bools | int | None, ...]:
        """What every kernel that goes through the rays of a lane begins its arguments with.

        The object points first … last − 1, where the rays of each begin, picture, event and camera of the
        rays, the poses of the pictures and how they hang on the events, the values of a state (metres, local
        frame; interior orientation), the corrected rays with slope and basis (those of the lane alone), 1/σ,
        and which object points take part.
        """
        rays, ideal, pictures = self.observations.image_points, self.ideal_rays(state, lane), state.pictures
        return (
            *lane,
            self.point_start,
            rays.image,
            rays.event,
            rays.camera_of_image,
            pictures.projection_centre,
            pictures.local_from_camera,
            pictures.of_event,
            state.object_point,
            state.system[INTERIOR_ORIENTATION],
            ideal.xy,
            ideal.slope,
            ideal.basis,
            rays.inverse_sigma,
            self.active_point,
        )

    @property
    def unknowns(self) -> int:
        """Number u of unknowns that take part."""
        layout = self.layout
        return 6 * layout.events + 3 * int(self.active_point.sum()) + layout.border

    @property
    def redundancy(self) -> int:
        """N − u; a free network has as many more as its datum has open directions."""
        return self.observations.count - self.unknowns


def with_known_basis(block: Block, observations: Observations) -> Observations:
    """With what the additional parameters do at the measured points, where those points stay.

    What is made of such observations, rejected or not, need not find it again.

    Raises
    ------
    InconsistentBlockError : if the block has other additional parameters than the image points.
    """
    refuse_other_calibration(block, observations.image_points.self_calibration)
    if ray_columns(block.layout, observations.image_points).principal_point_is_free:
        return observations
    rays = observations.image_points.with_known_basis(block.approximate_state())
    return replace(observations, image_points=rays)


def determined_points(block: Block, observations: Observations) -> Bools:
    """Object points (m,) with enough observations: two rays, or one and a known height, or a full survey.

    Rays of several heads of one event count as one: they come from one place.
    """
    rays = observations.image_points
    equations = 2.0 * rays.seen_from(rays.active, len(block.points))
    for group in observations.others:
        if isinstance(group, JoinsPoints):  # it holds its points together, wherever they are
            continue
        touching = group.point >= 0
        present = group.stochastic.present[touching].sum(axis=1)
        np.add.at(equations, group.point[touching], present)
    return equations >= 3


def _correlated_events(observations: Observations) -> tuple[Ints, Ints]:
    """Pairs (k,) of events that errors correlated over time join.

    Neighbours share rows of the whitened equations, and an error of one observation alone shows in those of
    both its neighbours; what is rejected is tested between the neighbours it would have.
    """
    pairs = []
    for group in observations.others:
        neighbours = group.stochastic.neighbours
        if neighbours is not None:
            before, after = group.event[neighbours.before], group.event[neighbours.after]
            pairs += [(before, group.event), (group.event, after), (before, after)]
    if not pairs:
        nothing = np.zeros(0, dtype=np.int64)
        return nothing, nothing
    return np.concatenate([one for one, _ in pairs]), np.concatenate([other for _, other in pairs])


def _of_active_points(observations: Observations, active: Bools) -> Observations:
    """Without the single rays and partial surveys of object points that they do not determine."""
    kept = np.append(active, True)  # the last one serves what belongs to no object point (−1)
    rays = observations.image_points
    others = [group.without(~kept[group.point]) for group in observations.others]
    return Observations(
        rays.without(~kept[rays.point]),
        tuple(
            group.without(~kept[group.other_point]) if isinstance(group, JoinsPoints) else group
            for group in others
        ),
    )
