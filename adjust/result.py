"""What an adjustment returns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from adjust.arrays import Bools, Floats, Ints
from adjust.block import Block
from adjust.joint_covariance import JointCovariance, joint_covariance
from adjust.notebook.summary import one_line, page
from adjust.observations.base import ObservationGroup
from adjust.observations.image_point import ImagePoints
from adjust.parameters import InnerConstraints, ParameterLayout, State
from adjust.quality.cofactor import Cofactor
from adjust.quality.control_checks import ControlCheck
from adjust.quality.correlation_time import CorrelationTime
from adjust.quality.global_test import GlobalTest
from adjust.quality.joint_cofactor import JointCofactor
from adjust.quality.variance_components import VarianceComponent
from adjust.solve.datum import DatumShare
from adjust.solve.defect import OpenDirection
from adjust.solve.gauss_newton import Iteration, Solution
from adjust.solve.system import Observations, System

if TYPE_CHECKING:
    from pandas import DataFrame
    from plotly.graph_objects import Figure

    from adjust.notebook.tables import Table


class ObservationStatus(IntEnum):
    """Outcome for one component of an observation.

    NOT_USED: never observed, or a ray whose point was given up when another ray was rejected.
    """

    USED = 0
    REJECTED = 1
    UNCONTROLLED = 2
    NOT_USED = 3


@dataclass(frozen=True, eq=False, repr=False)
class GroupResult:
    """Residuals of one group; arrays (n, m), in the order of its observations.

    Attributes
    ----------
    group : the observations as given (nothing rejected). Image points are sorted by object point:
        ``group.image`` and ``group.point`` say which each is.
    residual : v = adjusted − observed, SI and radians.
    sigma : a-priori standard deviations, or those of the estimated variance components.
    redundancy : redundancy numbers; NaN for what is not used.
    standardized : w for an a-priori σ0 of 1; NaN for what is not used.
    detectable : minimal detectable bias, SI and radians; NaN for what is not used.
    control : σ² (P Q_vv P)_ii, without correlations the redundancy number; NaN for what is not used.
    status : values of :class:`ObservationStatus`.
    weighted_squares : vᵀPv of the group.
    """

    group: ObservationGroup
    residual: Floats
    sigma: Floats
    redundancy: Floats
    standardized: Floats
    detectable: Floats
    control: Floats
    status: Ints
    weighted_squares: float

    def __repr__(self) -> str:
        return (
            f"<GroupResult of {self.group.name}: {len(self.residual):,} observations, "
            f"{self.rejected:,} rejected; redundancy {self.redundancy_sum:,.1f}, σ0 {self.sigma0:.3f}>"
        )

    @property
    def rejected(self) -> int:
        """Number of observations with a rejected component."""
        return int((self.status == ObservationStatus.REJECTED).any(axis=1).sum())

    @property
    def taking_part(self) -> ObservationGroup:
        """The observations that were used, weighted as in the adjustment."""
        took_part = np.isin(self.status, (ObservationStatus.USED, ObservationStatus.UNCONTROLLED))
        return self.group.without(np.asarray(~took_part.any(axis=1)))

    @property
    def external(self) -> Floats:
        """External reliability δ̄ (n, m): effect on the results of an undetected error of detectable size.

        δ̄² = ∇₀² (P A Q Aᵀ P)_ii, for uncorrelated components δ0² (1 − r)/r: no function of the unknowns moves
        by more than δ̄ of its own standard deviation (Baarda 1968). NaN where ∇₀ is.
        """
        return self.external_of(np.arange(len(self.detectable)))

    def external_of(self, observations: Ints) -> Floats:
        """External reliability (k, m) of some observations (k,) of the group."""
        model = self.group.stochastic
        if model.over_time is not None:  # the weights depend on who the neighbours are
            model = model.without((self.status == ObservationStatus.REJECTED).any(axis=1))
        with np.errstate(invalid="ignore"):
            scatter = self.control[observations] / model.sigma[observations] ** 2
        fitted = model.weight_diagonal(observations) - scatter
        return np.asarray(self.detectable[observations] * np.sqrt(np.maximum(fitted, 0.0)))

    @property
    def redundancy_sum(self) -> float:
        """Redundancy of the group."""
        return float(np.nansum(self.redundancy))

    @property
    def sigma0(self) -> float:
        """σ0 of the group, √(vᵀPv / r); NaN where it has no redundancy. Of a shared reading r counts once."""
        # Of image points without the matrices of the general form, which would be large.
        shares = 1.0 if isinstance(self.group, ImagePoints) else self.group.stochastic.shares
        total = float(np.nansum(self.redundancy * shares))
        return float(np.sqrt(self.weighted_squares / total)) if total > 1e-6 else float("nan")


@dataclass(frozen=True)
class FreeNetwork:
    """The datum of a free network.

    Attributes
    ----------
    constrained : the unknowns whose corrections to the approximate values have the least norm.
    directions : parts of the datum that no observation determines; empty if all are determined.
    """

    constrained: InnerConstraints
    directions: tuple[OpenDirection, ...]

    @property
    def defect(self) -> int:
        """Number d of open directions."""
        return len(self.directions)


@dataclass(frozen=True, eq=False, repr=False)
class AdjustmentResult:
    """An adjusted block with everything known about its quality.

    Attributes
    ----------
    block : what was adjusted.
    state : adjusted values.
    layout : the place of the unknowns.
    cofactor : cofactor matrices (a-priori σ0 = 1); times σ0² they are covariances.
    test : σ0 and its χ² test.
    groups : residuals of every group, image points first.
    iterations : of every pass; the last one is the final adjustment, which is not robust.
    rejected_per_pass : number of observations each pass rejected.
    active_point : (m,) whether the object point was used.
    datum : the share of each group in fixing the block in space.
    system, solution : the last adjustment, without rejected observations, with factorised normal equations.
    variance_components : of every part of the observations; empty if none were requested.
    reweighted : number of adjustments with changed weights.
    given_up : indices of object points that were removed because it cannot be determined which of their
        observations is wrong, or because too few are left.
    inseparable : indices of control points one of which is wrong; it cannot be determined which, and none was
        rejected.
    taken_back : number of rejected observations that were restored because they fit in the end.
    left_out_singly : each control point predicted by an adjustment without it; None without control points.
    left_out_by_fold : control points predicted by an adjustment without their fold; None if not requested.
    joint_cofactor : of the requested object points; None if none were requested, or if approximate values
        fix part of the datum, so that coordinates have no meaning of their own.
    correlation_times : of the groups with errors correlated over time; empty if not estimated.
    free_network : the datum fixed by approximate values, to whose inner constraints the cofactors refer; None
        if this was not allowed.
    """

    block: Block
    state: State
    layout: ParameterLayout
    cofactor: Cofactor
    test: GlobalTest
    groups: tuple[GroupResult, ...]
    iterations: tuple[tuple[Iteration, ...], ...]
    rejected_per_pass: tuple[int, ...]
    active_point: Bools
    datum: tuple[DatumShare, ...]
    system: System
    solution: Solution
    variance_components: tuple[VarianceComponent, ...] = ()
    reweighted: int = 0
    given_up: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    taken_back: int = 0
    left_out_singly: ControlCheck | None = None
    left_out_by_fold: ControlCheck | None = None
    joint_cofactor: JointCofactor | None = None
    correlation_times: tuple[CorrelationTime, ...] = ()
    free_network: FreeNetwork | None = None
    inseparable: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def observations(self) -> Observations:
        """The observations that were used, weighted as in the adjustment."""
        return self.system.observations

    @property
    def sigma0(self) -> float:
        """Factor of all standard deviations: σ0 a posteriori; 1 without redundancy."""
        return self.test.sigma0 if self.test.redundancy > 0 else 1.0

    def covariance(
        self,
        points: Sequence[str] = (),
        images: Sequence[str] = (),
        parameters: Sequence[str] = (),
        sigma0: float | None = None,
    ) -> JointCovariance:
        """Joint covariance matrix of any unknowns, by their names; for some hundred of them.

        Parameters
        ----------
        points : names of object points; three coordinates each, local axes.
        images : names of images; projection centre in local axes, small rotation in the camera frame.
        parameters : families ("boresight"), parameters ("boresight_roll") or one of them ("boresight_roll of
            CAMERA"); of the first two, all that are estimated.
        sigma0 : factor of the standard deviations; None: that of the residuals. Observations without errors,
            as of a plan, have none: then 1.

        Raises
        ------
        UnknownNameError : a name does not exist, comes twice, or is of something that is not an unknown.
        """
        factor = self.sigma0 if sigma0 is None else sigma0
        return joint_covariance(
            self.system, self.solution, self.cofactor.errors_of_unknowns, factor, (images, parameters, points)
        )

    def __repr__(self) -> str:
        return one_line(self)

    def _repr_html_(self) -> str:
        return page(self)

    def to_dataframe(self, table: Table = "parameters", sigma0: float | None = None) -> DataFrame:
        """A table of the result for pandas, in SI units and radians.

        Parameters
        ----------
        table : "parameters" (estimated system parameters), "images", "points" or "observations".
        sigma0 : factor of the standard deviations of unknowns; None: that of the residuals. Observations
            without errors, as of a plan, have none: then 1.

        Raises
        ------
        UnknownNameError : there is no such table.
        """
        from adjust.notebook.tables import table_of

        return table_of(self, table, sigma0)

    def plot(self) -> Figure:
        """The block in plan: exposures, object points by the σ of their height, what was rejected.

        Raises
        ------
        MissingExtraError : plotly is not installed.
        """
        from adjust.notebook.charts import plan

        return plan(self)
