"""What readers return: columns as they are in the file, and the line of every row.

Nothing is converted here. Units, frames and datums are declared in the project file and applied in
``tasks.stages.ingest``; a reader only knows the file's layout. Texts are Arrow arrays, numbers numpy arrays;
a number that is not given is NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Lines: TypeAlias = NDArray[np.integer[Any]]
AngleOrder: TypeAlias = Literal["omega-phi-kappa", "phi-omega-kappa", "heading-pitch-roll"]


@dataclass(frozen=True, slots=True)
class FileStatement:
    """Statements of a file about its numbers; the project file must agree with them.

    Attributes
    ----------
    crs : as PROJ understands it, or ``local``; None, like all others: not stated.
    datum : name of the datum, where `crs` has none.
    heights : the height system.
    order, reference : of the angles.
    position : what positions are of.
    """

    crs: str | None = None
    datum: str | None = None
    heights: Literal["ellipsoidal"] | None = None
    order: AngleOrder | None = None
    reference: Literal["grid", "true-north", "local"] | None = None
    position: Literal["projection_centre"] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ImagePointRecords:
    """Image points as read.

    Attributes
    ----------
    file : the file they came from.
    image, point : names, text (n,), each kept once (with a dictionary).
    xy : (n, 2) in the unit the project file declares: column, row, or x, y in the image system.
    sigma : (n, 2) in the same unit, NaN where the row gives none.
    line : (n,) 1-based line of each row.
    extra : further columns of the file, text (n,), verbatim.
    """

    file: Path
    image: pa.DictionaryArray
    point: pa.DictionaryArray
    xy: Floats
    sigma: Floats
    line: Lines
    extra: Mapping[str, pa.Array] = field(default_factory=dict)

    def without_names(self) -> ImagePointRecords:
        """The same with empty columns of image and point names."""
        return replace(self, image=self.image.slice(0, 0), point=self.point.slice(0, 0))


@dataclass(frozen=True, slots=True, eq=False)
class HeadRecord:
    """How a head of a rig sits beside its reference head, as a file describes it.

    Attributes
    ----------
    reference : name of the camera that is the reference head.
    rotation : (3, 3) reference head from head, axes of both x right, y down, z forward.
    position : (3,) projection centre of the head in these axes of the reference head, metres.
    """

    reference: str
    rotation: Floats
    position: Floats


@dataclass(frozen=True, slots=True, eq=False)
class ExposureRecords:
    """Exposures as read.

    Attributes
    ----------
    file : the file they came from.
    image, camera, strip, flight : names, text (n,); null where the row gives none.
    time_s : (n,) seconds on any scale that is continuous within a flight.
    position : (n, 3) x (east), y (north), z in the CRS and heights the project file declares; NaN where an
        exposure has none.
    angles : (n, 3) in the declared unit: ω, φ, κ (also for phi-omega-kappa), or heading, pitch, roll.
    sigma_position, sigma_angles : (n, 3) in the units of their quantities and in the same order.
    line : (n,) 1-based line of each row.
    rates : (n, 3) of the body about its axes, in the unit of the angles per second; None: the file has none,
        NaN where a row gives none.
    declared_angle_unit : the unit a header of the file itself names, None if it names none.
    extra : further columns of the file, text (n,), verbatim.
    states : what else the file itself says.
    remarks : sentences for the user about what the file says besides.
    solution : kind of the GNSS solution of each position (`tasks.formats.trajectory_records`), text (n,);
        None: the file does not say.
    velocity : (n, 3) true east, north, up, m/s, of the point that the positions are of; None: not known, NaN
        where an exposure has none.
    event : names of the events that images of heads of a rig belong to, text (n,); None: the file has none.
    heads : by the names of cameras, the heads that are not the reference of their rig.
    """

    file: Path
    image: pa.Array
    camera: pa.Array
    strip: pa.Array
    flight: pa.Array
    time_s: Floats
    position: Floats
    angles: Floats
    sigma_position: Floats
    sigma_angles: Floats
    line: Lines
    rates: Floats | None = None
    declared_angle_unit: Literal["deg", "gon", "rad"] | None = None
    extra: Mapping[str, pa.Array] = field(default_factory=dict)
    states: FileStatement = FileStatement()
    remarks: tuple[str, ...] = ()
    solution: pa.Array | None = None
    velocity: Floats | None = None
    event: pa.Array | None = None
    heads: Mapping[str, HeadRecord] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class ControlRecords:
    """Control and check points as read.

    Attributes
    ----------
    file : the file they came from.
    point : names, text (n,).
    position : (n, 3) x (east), y (north), z; NaN where a coordinate is not known.
    sigma : (n, 3) metres, NaN where the row gives none.
    role : text (n,) ``control`` or ``check``, null where the row gives none.
    remarks : sentences for the user about what the reader had to interpret.
    line : (n,) 1-based line of each row.
    extra : further columns of the file, text (n,), verbatim.
    states : what the file itself says of its coordinates.
    """

    file: Path
    point: pa.Array
    position: Floats
    sigma: Floats
    role: pa.Array
    line: Lines
    extra: Mapping[str, pa.Array] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    states: FileStatement = FileStatement()


@dataclass(frozen=True, slots=True, eq=False)
class DistanceRecords:
    """Measured distances between object points as read.

    Attributes
    ----------
    file : the file they came from.
    point, other_point : names of both ends, text (n,).
    distance : (n,) in the unit the project file declares.
    sigma : (n,) in the same unit, NaN where the row gives none.
    role : text (n,) ``control`` or ``check``, null where the row gives none.
    line : (n,) 1-based line of each row.
    extra : further columns of the file, text (n,), verbatim.
    """

    file: Path
    point: pa.Array
    other_point: pa.Array
    distance: Floats
    sigma: Floats
    role: pa.Array
    line: Lines
    extra: Mapping[str, pa.Array] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class CameraRecord:
    """A frame camera as a file describes it.

    Attributes
    ----------
    columns, rows : size of the image, px.
    pixel_um : pixel size, µm.
    focal_length_mm : principal distance, mm.
    principal_point_mm : x, y in the image system (from the format centre), mm.
    additional_parameters : distortion, as the project file would give it.
    """

    columns: int
    rows: int
    pixel_um: float
    focal_length_mm: float
    principal_point_mm: tuple[float, float]
    additional_parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class PixelCamera:
    """A frame camera of a file that knows pixels only; the project file declares their size.

    Attributes
    ----------
    columns, rows : size of the image, px.
    focal_length_px : principal distance, px.
    principal_point_px : x, y in the image system (from the format centre, y up), px.
    additional_parameters : distortion, as the project file would give it.
    """

    columns: int
    rows: int
    focal_length_px: float
    principal_point_px: tuple[float, float]
    additional_parameters: Mapping[str, float] = field(default_factory=dict)

    def with_pixel(self, pixel_um: float) -> CameraRecord:
        """The camera with pixels of this size, µm."""
        pixel_mm = pixel_um * 1e-3
        x0, y0 = self.principal_point_px
        return CameraRecord(
            self.columns,
            self.rows,
            pixel_um,
            self.focal_length_px * pixel_mm,
            (x0 * pixel_mm, y0 * pixel_mm),
            self.additional_parameters,
        )
