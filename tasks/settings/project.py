"""The project file as a whole."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import date
from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field, PrivateAttr, model_validator

from tasks.plain_text import LONGEST_NAME
from tasks.settings.adjustment import AdjustmentSettings
from tasks.settings.base import Settings, trouble
from tasks.settings.burn_in import BurnInSettings
from tasks.settings.calibration import CalibrationSettings
from tasks.settings.cameras import REGISTRY, RIG_REGISTRY, CameraInput
from tasks.settings.certificate import CertificateSettings
from tasks.settings.coordinates import Heights, PlacedSettings, one_table_or_several
from tasks.settings.deliver import DeliverSettings
from tasks.settings.direct_georeferencing import DirectGeoreferencingSettings
from tasks.settings.image_quality import ImageQualitySettings
from tasks.settings.inputs import Inputs
from tasks.settings.quality import TRUST_MAP_GATES, ChecksSettings, Gates
from tasks.settings.statement import StatementSettings
from tasks.settings.sweep import SweepSettings
from tasks.settings.trust_map import TrustMapSettings


class ProjectSettings(PlacedSettings):
    """Name of the project and the coordinate system of its results."""

    outside_key: ClassVar[frozenset[str]] = frozenset({"name", "flown"})

    name: str = Field(min_length=1, max_length=LONGEST_NAME)
    """Name of the project, for display."""
    flown: date | None = None
    """Date of the flight, e.g. 2012-05-24; determines which calibration of the registry is valid."""
    crs: str
    """CRS of the results: a projected CRS in metres, e.g. "EPSG:2154", or "local" (metric Cartesian)."""
    heights: Heights
    """Height system of the results; not needed with crs = "local"."""


@dataclass(frozen=True)
class ProjectSource:
    """The origin of a project's settings; it does not matter when projects are compared.

    Attributes
    ----------
    sha256 : digest of the project file, byte for byte; empty if there is no file.
    overrides : texts ``a.b.c=VALUE`` that replaced values of it.
    """

    sha256: str = field(default="", compare=False)
    overrides: tuple[str, ...] = field(default=(), compare=False)


class Project(Settings):
    """A project file."""

    # What a sweep varies is not a setting of the project itself; the certificate alone is told who signs it;
    # deliveries are made of published results; images are examined by themselves.
    outside_key: ClassVar[frozenset[str]] = frozenset({"sweep", "certificate", "deliver", "image_quality"})

    version: Literal[1]
    """Version of the project file, 1."""
    project: ProjectSettings
    """Name of the project and coordinate system of the results."""
    cameras: dict[str, CameraInput] = Field(min_length=1)
    """One table for each camera; its name is the one used in the exposures."""
    inputs: Inputs
    """The files."""
    adjustment: AdjustmentSettings = Field(default_factory=AdjustmentSettings)
    """The bundle adjustment."""
    calibration: CalibrationSettings = Field(default_factory=CalibrationSettings)
    """The system calibration."""
    burn_in: BurnInSettings | None = None
    """The burn-in protocol of a camera with composed images; default: none."""
    direct_georeferencing: DirectGeoreferencingSettings = Field(default_factory=DirectGeoreferencingSettings)
    """The direct-georeferencing check."""
    checks: ChecksSettings = Field(default_factory=ChecksSettings)
    """Limits of the plausibility checks before the adjustment."""
    gates: Gates = Field(default_factory=Gates)
    """Quality gates: limits that the results must meet."""
    trust_map: TrustMapSettings | None = None
    """The trust map: accuracy of new points over the ground; default: none."""
    certificate: CertificateSettings = Field(default_factory=CertificateSettings)
    """Laboratory and signatories; affects no number, and a change repeats only the certificate."""
    deliver: Annotated[tuple[DeliverSettings, ...], BeforeValidator(one_table_or_several)] = ()
    """Deliveries for other programs, written at the end of a run that adjusts; `[[deliver]]` for each of
    several.
    """
    statement: Annotated[tuple[StatementSettings, ...], BeforeValidator(one_table_or_several)] = ()
    """Accuracy statements required by authorities, derived from the check points of the adjustment;
    `[[statement]]` for each of several.
    """
    sweep: SweepSettings | None = None
    """Scenarios computed by `aerocal sweep`."""
    image_quality: ImageQualitySettings | None = None
    """Images examined by `aerocal image-quality`."""

    _source: ProjectSource = PrivateAttr(default=ProjectSource())

    @property
    def has_heads(self) -> bool:
        """Whether any camera is a head of a rig next to another one."""
        return any(camera.head is not None for camera in self.cameras.values())

    @property
    def source(self) -> ProjectSource:
        """The file the settings were read from."""
        return self._source

    def read_from(self, source: ProjectSource) -> Project:
        """The same settings with where they are from."""
        copy = self.model_copy()
        copy._source = source
        return copy

    @model_validator(mode="after")
    def _certificate_fits(self) -> Project:
        wrong = self.certificate.trouble_with(self.cameras, self.project.flown)
        if wrong is not None:
            raise trouble(*wrong)
        return self

    @model_validator(mode="after")
    def _heads_have_their_reference(self) -> Project:
        for name, camera in self.cameras.items():
            if camera.head is None:
                continue
            reference = self.cameras.get(camera.head.reference)
            if reference is None or reference.head is not None or camera.head.reference == name:
                raise trouble(
                    f"The camera {name} is a head with the reference {camera.head.reference}, which is "
                    f"{'not a camera' if reference is None else 'not a reference head'}.",
                    "Name the one camera of the body that has no `head` itself.",
                )
        return self

    @model_validator(mode="after")
    def _film_has_its_marks(self) -> Project:
        film = next((name for name, camera in self.cameras.items() if camera.is_film), None)
        if film is not None and self.inputs.image_points and not self.inputs.fiducials:
            raise trouble(
                f"The camera {film} has fiducial marks, but no measured ones are delivered.",
                "Name their files (inputs.fiducials); remove the marks of the camera only if the image "
                "points are in the system of the camera, corrected for film deformation.",
            )
        if self.inputs.fiducials and film is None:
            raise trouble(
                "Measured fiducial marks are delivered, but no camera has any.",
                "Give their calibrated coordinates, fiducials_mm or calibration_report of the camera.",
            )
        return self

    @model_validator(mode="after")
    def _only_reduced_positions_were_reduced(self) -> Project:
        name = next((name for name, one in self.cameras.items() if one.reduced_by_m is not None), None)
        if name is not None and all(one.position != "projection_centre" for one in self.inputs.exposures):
            raise trouble(
                f"reduced_by_m of the camera {name} is the lever arm of positions that were reduced to the "
                "projection centre, but no exposures have such positions.",
                'Leave it out, or declare position = "projection_centre" for the exposures.',
            )
        return self

    @model_validator(mode="after")
    def _burn_in_of_one_platform(self) -> Project:
        platforms = {camera.head.reference for camera in self.cameras.values() if camera.head is not None}
        if self.burn_in is not None and len(platforms) != 1:
            raise trouble(
                f"A burn-in protocol is of one platform with heads; the project has {len(platforms)}.",
                "Declare the virtual image as the reference head of the cameras, or remove [burn_in].",
            )
        return self

    @model_validator(mode="after")
    def _one_calibration_of_a_rig(self) -> Project:
        for name, camera in self.cameras.items():
            if camera.calibration != RIG_REGISTRY:
                continue
            heads = [other for other, one in self.cameras.items() if one.head and one.head.reference == name]
            if not heads:
                raise trouble(
                    f"The calibration of a rig is to be used for {name}, which is no reference head.",
                    f'Set cameras.{name}.calibration = "{REGISTRY}".',
                )
            twice = [other for other in heads if self.cameras[other].states_covariance]
            if twice:
                raise trouble(
                    f"The calibration of the rig of {name} includes {', '.join(twice)}, which also has a "
                    "calibration of its own.",
                    f"Remove calibration and head_certificate from cameras.{twice[0]}.",
                )
        return self

    @model_validator(mode="after")
    def _gates_have_their_map(self) -> Project:
        wanted = [name for name in TRUST_MAP_GATES if getattr(self.gates, name) is not None]
        if wanted and self.trust_map is None:
            raise trouble(f"The gate {wanted[0]} needs a trust map.", "Add the table [trust_map].")
        return self

    @model_validator(mode="after")
    def _deliveries_fit(self) -> Project:
        places: set[str] = set()
        for one in self.deliver:
            wrong = one.trouble_with(self.project.crs, flown=self.project.flown is not None)
            if wrong is not None:
                raise trouble(*wrong)
            if one.place in places:
                raise trouble(
                    f"Two deliveries have the folder {one.place}.", "Give each a `folder` of its own."
                )
            places.add(one.place)
        return self

    @model_validator(mode="after")
    def _something_to_adjust(self) -> Project:
        if not self.inputs.image_points and self.calibration.adjusted is None:
            raise trouble(
                "The project has no image points (inputs.image_points).",
                "Name their files; without any, `aerocal calibrate` needs orientations of another adjustment "
                "(calibration.adjusted).",
            )
        return self
