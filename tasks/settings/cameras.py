"""Settings of a camera: its image, its interior orientation as certified, and how it is mounted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, ClassVar, Literal, TypeAlias

from pydantic import AfterValidator, Field, PrivateAttr, model_validator

from tasks.formats.register import CAMERA_FORMATS, TABLE
from tasks.magnitude import MOST_PIXELS
from tasks.settings.base import InputPath, Settings, one_of, trouble
from tasks.settings.camera_identity import CameraIdentity
from tasks.settings.coordinates import Finite, Positive, Real, Triple, Whole
from tasks.settings.table_layout import TableSettings

#: Where the calibrated values of a camera come from.
GIVEN, REGISTRY, RIG_REGISTRY = "given", "registry", "registry-rig"
CALIBRATIONS = (GIVEN, REGISTRY, RIG_REGISTRY)
#: Columns or rows of an image.
Pixels: TypeAlias = Annotated[Whole, Field(gt=0, le=MOST_PIXELS)]
_INLINE = ("columns", "rows", "pixel_um", "focal_length_mm", "principal_point_mm")


class CcdTiles(Settings):
    """The CCD images that form a composed image; 3 × 3 of them have two seams in each direction."""

    seams_x_mm: tuple[Finite, ...]
    """Borders between CCD images along x of the calibration axes, ascending, mm."""
    seams_y_mm: tuple[Finite, ...]
    """The same along y, mm."""
    blend_mm: Annotated[Real, Field(ge=0.0, allow_inf_nan=False)] = 0.0
    """Width over which neighbouring images are blended linearly, mm; 0: a sharp border."""
    perspective: Literal["master4", "outer8", "rotation8"] = "master4"
    """Type of the parameters `bluh:66-73`: two tilts for each of the four corner CCDs (`master4`), one for
    each of the eight outer CCDs (`outer8`), or their rotations (`rotation8`).
    """

    @model_validator(mode="after")
    def _ascending(self) -> CcdTiles:
        for name in ("seams_x_mm", "seams_y_mm"):
            seams = getattr(self, name)
            if any(after <= before for before, after in pairwise(seams)):
                raise trouble(f"The seams {list(seams)} do not ascend.", f"Give {name} in ascending order.")
        return self


@dataclass(frozen=True)
class CalibrationCovariance:
    """How well the values of a calibration are known.

    Attributes
    ----------
    parameters : names of the k calibrated parameters of the camera and its mounting.
    covariance : (k, k) in products of the units of parameters.parquet.
    cameras : (k,) which head of a rig each belongs to; empty: all of them to the camera itself.
    """

    parameters: tuple[str, ...]
    covariance: tuple[tuple[float, ...], ...]
    cameras: tuple[str, ...] = ()

    def only(self, chosen: Sequence[int]) -> CalibrationCovariance:
        """What is known of some of the parameters, by their places."""
        matrix = tuple(tuple(self.covariance[i][j] for j in chosen) for i in chosen)
        cameras = tuple(self.cameras[i] for i in chosen) if self.cameras else ()
        return CalibrationCovariance(tuple(self.parameters[i] for i in chosen), matrix, cameras)


class HeadSettings(Settings):
    """Position and rotation of a head of a rig relative to the reference head."""

    reference: str
    """Name of the camera that is the reference head."""
    rotation_deg: Triple = (0.0, 0.0, 0.0)
    """Rotation relative to the reference head, roll, pitch, yaw about the body axes, degrees: mounting =
    R_z(yaw) R_y(pitch) R_x(roll) T with the `mount_deg` of both cameras. `[45, 0, 0]` looks to the left, `[0,
    45, 0]` ahead. The initial value if it is estimated, otherwise fixed.
    """
    position_m: Triple = (0.0, 0.0, 0.0)
    """Projection centre relative to that of the reference head, body axes (forward, right, down), m:
    likewise.
    """
    synchronisation_offset_s: Finite = 0.0
    """Delay of the exposure of the head relative to the time of the event, s (the reference head is exposed
    at this time): likewise. Its position and rotation then follow from velocity and rates of the body.
    """


class CameraTable(TableSettings):
    """Layout of a table of cameras."""

    # The table of the camera has the key.
    format: ClassVar[str] = "csv"


def _refuse_beside_certificate(camera: CameraInput, given: list[str]) -> None:
    """Refuse values beside a head's certificate, which fully describes its images, not a composed one."""
    also = [*given, *(name for name in ("file", "pixel_um") if getattr(camera, name) is not None)]
    if also or camera.calibration in (REGISTRY, RIG_REGISTRY):
        raise trouble(
            f"The camera has a head_certificate and also {', '.join(also) or 'a registered calibration'}.",
            "Keep only one of the two, so that they cannot differ.",
        )
    if camera.identity.product != "camera_head":
        raise trouble(
            "A head_certificate is of one camera head, and the images of this camera are virtual_image: "
            "composed images have no distortion left, and a head's calibration must not be applied to them.",
            'Leave it out; or give identity.product = "camera_head" if these are the pictures of the head.',
        )


def _refuse_beside_report(camera: CameraInput) -> None:
    """The calibration report of a film camera says all but the size of its scanned images."""
    taken = ("file", "head_certificate", "focal_length_mm", "principal_point_mm", "fiducials_mm")
    also = [name for name in taken if getattr(camera, name)]
    also += [name for name in camera.additional_parameters if name.startswith("brown")]
    if also or camera.calibration != GIVEN:
        raise trouble(
            f"The camera has a calibration_report and also {', '.join(also) or 'a registered calibration'}.",
            "Keep only one of the two, so that they cannot differ.",
        )
    missing = [name for name in ("columns", "rows", "pixel_um") if getattr(camera, name) is None]
    if missing:
        raise trouble(f"The camera lacks {', '.join(missing)}.", "Add them: they are those of the scans.")


class CameraInput(Settings):
    """A frame camera, from a file or written out here; the table's name is the camera's name."""

    file: InputPath | None = None
    """Camera file; instead of the values below."""
    format: Annotated[str, AfterValidator(one_of(CAMERA_FORMATS, "format of cameras"))] | None = Field(
        default=None,
        description=f"Format of `file`: {', '.join(f'`{name}`' for name in CAMERA_FORMATS.own)}.",
    )
    head_certificate: InputPath | None = None
    """Calibration certificate of a single camera head, with standard deviations (see
    [rigs](rigs.md#certificates-of-heads)); instead of a `file` or the values below. What it states is used as
    `calibration_use` says. Only for the pictures of the head itself: `identity.product = "camera_head"`.
    """
    calibration_report: InputPath | None = None
    """Calibration report of a film camera (see [film images](import.md#film-images)): focal length, principal
    point, fiducial marks and radial distortion; next to `columns`, `rows`, `pixel_um` of the scans.
    """
    name_in_file: Annotated[str, Field(min_length=1)] | None = None
    """Name (or number) of the camera in `file`, if the file contains several."""
    table: CameraTable = CameraTable()
    """Layout of `file` with `format = "csv"`, where it is not aerocal's own: keys of [tables of
    others](#tables-of-others). Columns are `camera`, `columns`, `rows`, `pixel_um`, `focal_length_mm`,
    `x0_mm`, `y0_mm`, and, to be compared with them, `width_mm`, `height_mm`.
    """
    columns: Pixels | None = None
    """Width of the image, px."""
    rows: Pixels | None = None
    """Height of the image, px."""
    pixel_um: Positive | None = None
    """Side of a (square) pixel, µm; also together with a `file` that contains only pixel units."""
    focal_length_mm: Positive | None = None
    """Principal distance c, mm."""
    principal_point_mm: tuple[Finite, Finite] | None = None
    """Principal point x, y in the image system (from the format centre), mm; also together with a table of
    cameras that has none.
    """
    pixel_origin: Literal["corner", "centre"]
    """Which point of the top-left pixel has the pixel coordinates (0, 0). The difference is half a pixel, as
    much as a principal point may change in a calibration.
    """
    mount_deg: Literal[0, 90, 180, 270]
    """κ_mount: the nominal rotation of the camera in the aircraft, T = diag(1, −1, −1) R_z(κ_mount); 0: image
    x (columns) points forward, 90: forward is −y (down the rows).
    """
    calibration_axes_deg: Literal[0, 90, 180, 270] = 0
    """Rotation from the image axes to the axes in which additional parameters are defined, counter-clockwise,
    degrees. In BLUH and UltraCam sets, x is along flight: 0 if the columns run along flight, 90 or 270 if
    they run across.
    """
    fiducials_mm: dict[str, tuple[Finite, Finite]] = Field(default_factory=dict)
    """Coordinates of the fiducial marks of a film camera according to its calibration report, in the image
    system, mm; keys are the names of the marks, e.g. `{ 1 = [-110.002, 110.001] }`.
    """
    tiles: CcdTiles | None = None
    """Layout of the CCD images; default: that of the parameter set."""
    additional_parameters: dict[str, Finite] = Field(default_factory=dict)
    """Known additional parameters, e.g. `{ "bluh:9" = 1.2e-9 }` in their published units: the initial value
    if the parameter is estimated, otherwise fixed. Values of OpenCV, COLMAP or Metashape are
    `"brown-forward:k1"` and so on.
    """
    lever_arm_m: Triple = (0.0, 0.0, 0.0)
    """Known lever arm from the projection centre to the point to which the positions refer, body axes
    (forward, right, down), m: the initial value if it is estimated, otherwise fixed.
    """
    reduced_by_m: Triple | None = None
    """Lever arm that was used to reduce positions to the projection centre (`position =
    "projection_centre"`), m. Default: `lever_arm_m` as given here, even if the registry contains another one.
    """
    boresight_deg: Triple = (0.0, 0.0, 0.0)
    """Known boresight misalignment roll, pitch, yaw in body axes, degrees: the initial value if it is
    estimated, otherwise fixed.
    """

    head: HeadSettings | None = None
    """For a head of a rig that is not the reference head: its position and rotation relative to the reference
    head. Its lever arm and boresight follow from those of the reference head. Images of the heads of a rig
    that were exposed in one flight within 1 ms belong to one event, which GNSS and INS observe once.
    """

    calibration: Annotated[str, AfterValidator(one_of(lambda: CALIBRATIONS, "calibration of a camera"))] = (
        GIVEN
    )
    """`given`: the values of this table or its file. `registry`: focal length, principal point, additional
    parameters, boresight and lever arm are taken from the calibration in the registry that is approved for
    this camera and `project.flown`; of a head of a rig only interior orientation and additional parameters.
    `registry-rig`, of the reference head: those of all heads, with their relative rotations, positions and
    synchronisation offsets, from the calibration of the rig.
    """
    calibration_use: Literal["consider", "prior", "held"] = "consider"
    """How the covariance of a calibration from the registry is used. `consider`: the values are held fixed,
    and their errors are included in every σ and test. `prior`: they are observed with their full covariance,
    and the block improves them. `held`: they are treated as exact, to reproduce other programs or as initial
    values. With `consider`, none of these parameters may be estimated. A calibration flight uses them only as
    initial values.
    """
    identity: CameraIdentity = CameraIdentity()
    """Serial numbers, for the certificate and the registry of calibrations."""

    # What the registry says; the key has it by the digest of the record in `calibration`.
    _covariance: CalibrationCovariance | None = PrivateAttr(default=None)

    @property
    def covariance(self) -> CalibrationCovariance | None:
        """How well the values are known, unless they are to be taken as exact."""
        return None if self.calibration_use == "held" else self._covariance

    @property
    def is_film(self) -> bool:
        """Whether it has fiducial marks."""
        return bool(self.fiducials_mm) or self.calibration_report is not None

    @property
    def states_covariance(self) -> bool:
        """Whether its values come with a covariance."""
        return self.calibration in (REGISTRY, RIG_REGISTRY) or self.head_certificate is not None

    def known_with(self, covariance: CalibrationCovariance) -> CameraInput:
        """The same camera with the covariance of its calibration."""
        copy = self.model_copy()
        copy._covariance = covariance
        return copy

    @model_validator(mode="after")
    def _file_or_values(self) -> CameraInput:
        beside = {"pixel_um"} | ({"principal_point_mm"} if self.format == TABLE else set())
        given = [name for name in _INLINE if getattr(self, name) is not None and name not in beside]
        missing = [name for name in _INLINE if getattr(self, name) is None]
        if self.file is not None and given:
            raise trouble(
                f"The camera has a file and also {', '.join(given)}.",
                "Keep only one of the two, so that they cannot differ.",
            )
        if self.file is not None and self.format is None:
            raise trouble("The format of the camera file is missing.", 'Add it, e.g. format = "ign-xml".')
        if "table" in self.model_fields_set and self.format != TABLE:
            raise trouble(
                "table is the layout of a table of cameras, and this camera has none.",
                'Leave it out, or declare format = "csv" and the file.',
            )
        if self.file is None and self.name_in_file is not None:
            raise trouble("name_in_file refers to a camera `file`, but there is none.", "Leave it out.")
        if not self.states_covariance and "calibration_use" in self.model_fields_set:
            raise trouble(
                "calibration_use applies to a calibration from the registry, but the values of this "
                "camera are given here.",
                'Add calibration = "registry", or leave calibration_use out.',
            )
        if self.head is not None and self.calibration == RIG_REGISTRY:
            raise trouble(
                f"The calibration of the rig is taken for all its heads at once, and this one is not the "
                f"reference head ({self.head.reference}).",
                f'Set cameras.{self.head.reference}.calibration = "{RIG_REGISTRY}", and leave it out here.',
            )
        twice = {"lever_arm_m", "boresight_deg"} & self.model_fields_set
        if self.head is not None and twice:
            raise trouble(
                f"The camera is a head of a rig and also has {' and '.join(sorted(twice))}.",
                "Leave them out: they follow from those of the reference head, rotation_deg and position_m.",
            )
        if self.calibration_report is not None:
            _refuse_beside_report(self)
        elif self.head_certificate is not None:
            _refuse_beside_certificate(self, given)
        elif self.file is None and missing:
            raise trouble(f"The camera lacks {', '.join(missing)}.", "Add them, or give a camera `file`.")
        return self
