"""The input of a writer: orientations and cameras as one kind of program expects them, and its format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.handover.refit import Freed
from tasks.handover.block_points import BlockPoints, no_points
from tasks.handover.distortion_grid import CameraGrids
from tasks.handover.lens import Lenses
from tasks.handover.receiver import HandedOver
from tasks.handover.results import Results
from tasks.settings.deliver import OFFERS, AngleOrder, AngleUnit, World


@dataclass(frozen=True)
class Angles:
    """An angle system: R = R_x(ω) R_y(φ) R_z(κ) or R = R_y(φ) R_x(ω) R_z(κ)."""

    order: AngleOrder = "omega-phi-kappa"
    unit: AngleUnit = "deg"


@dataclass(frozen=True, eq=False)
class Delivery:
    """A block to be written.

    Attributes
    ----------
    results : as adjusted.
    handed : orientations for the kind of program.
    angles : wanted, where a format leaves the choice.
    lenses : cameras of a format that takes distortion; else none.
    points : of a format that takes points; else none.
    grids : of the cameras, for a format that takes them; else none.
    """

    results: Results
    handed: HandedOver
    angles: Angles = field(default_factory=Angles)
    lenses: Lenses = field(default_factory=lambda: Lenses((), np.zeros(0)))
    points: BlockPoints = field(default_factory=no_points)
    grids: tuple[CameraGrids, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the images."""
        return self.results.images.names

    @property
    def misfit_px(self) -> Floats:
        """(n,) largest difference of an image between the program's model and ours, pixels."""
        return self.handed.misfit_px + self.lenses.misfit_px if self.lenses.models else self.handed.misfit_px

    @property
    def camera_names(self) -> list[str]:
        """Name of the camera of each image."""
        return [self.results.cameras[k].frame.name for k in self.results.images.camera]

    @property
    def sigmas(self) -> pd.DataFrame:
        """Standard deviations of the adjustment, columns of exterior_orientations.parquet."""
        table = self.results.orientations
        return table[[name for name in table.columns if name.startswith("sigma_")]]

    @property
    def correlations(self) -> pd.DataFrame:
        """Correlations of the elements of an orientation, where they are known."""
        table = self.results.orientations
        known = table[[name for name in table.columns if name.startswith("correlation_")]]
        return known.dropna(axis="columns", how="all")


#: Files a writer makes: name → text, or bytes of a binary one.
Files: TypeAlias = Mapping[str, str | bytes]


@dataclass(frozen=True)
class DeliveryFormat:
    """A format of blocks or results for other programs.

    Attributes
    ----------
    name : on the command line; what it is, and what it can be written for, is in `OFFERS`.
    write : the files.
    precision : how precisely its numbers are printed, in words.
    freed : what programs that read it let us change of the camera.
    seen : whether files for it were checked against the software itself or real files of it.
    lens : terms of the distortion it takes (see ``lens``); none: it takes no distortion.
    points : whether it takes image points, object points, or surveyed points.
    corrected : whether its image points are corrected by additional parameters and mean residuals; they count
        from the principal point then.
    surveyed : which control and check points it can have: none, complete ones, or all (not in a local world).
    straight : whether they are freed of refraction, too, and count from the format centre.
    grid : whether it takes distortion grids.
    oriented : whether it has orientations or points, and so a world.
    on_wgs84 : whether its local frame is one of WGS 84, whatever the datum of the project.
    rigs : what it has of rigs: nothing, all events, or those with an image of the reference head.
    """

    name: str
    write: Callable[[Delivery], Files]
    precision: str
    freed: Freed = field(default_factory=Freed)
    seen: bool = False
    lens: tuple[str, ...] = ()
    points: bool = False
    corrected: bool = False
    surveyed: Literal["none", "complete", "all"] = "complete"
    straight: bool = False
    grid: bool = False
    oriented: bool = True
    on_wgs84: bool = False
    rigs: Literal["none", "all", "with-reference"] = "none"

    @property
    def worlds(self) -> tuple[World, ...]:
        """Kinds of programs it can be written for."""
        return OFFERS[self.name].worlds

    @property
    def world(self) -> World:
        """The kind of program that usually reads it."""
        return self.worlds[0]
