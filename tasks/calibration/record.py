"""calibration.json: the complete record of one calibration of one camera and its mounting.

It holds everything a later project, the registry, a certificate or another program needs: which camera,
which parameters with their full covariance matrix, from which flight, inputs and software.
"""

from __future__ import annotations

import hashlib
from datetime import date
from typing import Literal, TypeAlias

import numpy as np
from pydantic import BaseModel, Field, field_validator, model_validator

from adjust.arrays import Floats
from tasks.files.json_text import json_text
from tasks.quantities import entity_kind
from tasks.settings.camera_identity import CameraIdentity

Verdict: TypeAlias = Literal["accepted", "restricted", "refused"]


class RecordModel(BaseModel, frozen=True, extra="forbid"):
    """Base of the parts of a record: immutable, without unknown keys."""


class CalibratedCamera(RecordModel):
    """The camera a calibration is of.

    Attributes
    ----------
    name : as the project calls it.
    identity : serial numbers of what was calibrated, where known.
    columns, rows, pixel_um : its image.
    mount_deg, calibration_axes_deg : see the settings of a camera.
    """

    name: str
    identity: CameraIdentity
    columns: int
    rows: int
    pixel_um: float
    mount_deg: int
    calibration_axes_deg: int = 0


class CalibratedParameter(RecordModel):
    """One parameter.

    Attributes
    ----------
    parameter, entity, unit : as in parameters.parquet.
    value : calibrated, or held.
    given : value before the calibration.
    sigma : a posteriori, including the effect of held quantities; None if it was held itself.
    sigma_prior : of its pseudo-observation; None without one.
    status : as in parameters.parquet, but significance is tested with this sigma.
    verdict : determined, weak, not determinable, or held.
    because : the reason of the verdict, a sentence, and what to fly; empty if there is nothing to say.
    """

    parameter: str
    entity: str
    unit: str
    value: float
    given: float
    sigma: float | None
    sigma_prior: float | None
    status: str
    verdict: Literal["determined", "weak", "not_determinable", "held"]
    because: str = ""

    @property
    def key(self) -> tuple[str, str]:
        """Parameter and entity."""
        return self.parameter, self.entity


class RecordedHeld(RecordModel):
    """A quantity that was held, and how well it was assumed to be known; included in every σ.

    Attributes
    ----------
    quantity, entity, unit : what was held; the entity is a camera or flight, or empty.
    sigma : of it.
    moves, moves_entity, part : the parameter in whose σ it has the largest part, and that part, 0 to 1.
    """

    quantity: str
    entity: str
    unit: str
    sigma: float
    moves: str
    moves_entity: str
    part: float


class CalibrationFlight(RecordModel):
    """The flight a calibration was made from, as recognised from the data.

    Attributes
    ----------
    project, crs : name of the project and CRS whose axes a GNSS shift refers to.
    flown : date of the flight; None if it was not declared.
    images, strips, object_points, image_points, control_points : how many were used.
    heights_m : flying heights above ground, one for each level.
    headings_deg : flight directions, one for each.
    gsd_m : ground sampling distance of each height.
    """

    project: str
    crs: str
    flown: date | None
    images: int
    strips: int
    object_points: int
    image_points: int
    control_points: int
    heights_m: tuple[float, ...]
    headings_deg: tuple[float, ...]
    gsd_m: tuple[float, ...]


class CalibrationRecord(RecordModel):
    """One calibration, of a camera or of all heads of a rig together.

    Attributes
    ----------
    camera : what was calibrated; of a rig its reference head.
    heads : the other heads of the rig; none of a camera alone.
    parameters : of the camera, its mounting and the flights, estimated and held ones.
    covariance : (k, k) of those with a ``sigma``, in their order, in products of their units.
    held : what was held and how well it is known; its effect is part of the covariance.
    sigma0, redundancy : of the adjustment.
    verdict : accepted; restricted: accepted, with restrictions that users must know; or refused.
    reasons : why it is refused, sentences.
    restrictions : what restricts it, sentences.
    remarks : further sentences for the reader.
    inputs : name of each delivered file → sha256.
    software : name → version.
    """

    format: Literal["aerocal-calibration"] = "aerocal-calibration"
    version: Literal[1] = 1
    camera: CalibratedCamera
    # A record without heads has the digest it always had.
    heads: tuple[CalibratedCamera, ...] = Field(default=(), exclude_if=lambda heads: not heads)
    parameters: tuple[CalibratedParameter, ...]
    covariance: tuple[tuple[float, ...], ...]
    held: tuple[RecordedHeld, ...] = ()
    flight: CalibrationFlight
    sigma0: float = Field(gt=0.0)
    redundancy: int
    verdict: Verdict
    reasons: tuple[str, ...] = ()
    restrictions: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    inputs: dict[str, str]
    software: dict[str, str]

    @field_validator("version", mode="before")
    @classmethod
    def _number(cls, value: object) -> object:
        # In Python true is 1.
        if isinstance(value, bool):
            raise ValueError("a version is a number")
        return value

    @model_validator(mode="after")
    def _of_one_opinion(self) -> CalibrationRecord:
        # As `tasks.calibration.verdicts.FlightVerdict` forms it: what is edited at one place only shows.
        verdict = "refused" if self.reasons else "restricted" if self.restrictions else "accepted"
        if self.verdict != verdict:
            raise ValueError(
                f"the verdict is '{self.verdict}', and its {len(self.reasons)} reasons and "
                f"{len(self.restrictions)} restrictions give '{verdict}'"
            )
        undetermined = [item for item in self.parameters if item.verdict in ("weak", "not_determinable")]
        if undetermined and verdict != "refused":
            item = undetermined[0]
            raise ValueError(
                f"the verdict is '{verdict}', and {item.parameter} of {item.entity} is "
                f"{item.verdict.replace('_', ' ')}, which refuses a calibration"
            )
        return self

    @model_validator(mode="after")
    def _consistent(self) -> CalibrationRecord:
        count = len(self.estimated)
        if len(set(self.names)) != len(self.names):
            raise ValueError("two heads have the same name")
        if len({item.key for item in self.parameters}) != len(self.parameters):
            raise ValueError("a parameter is listed twice")
        matrix = np.array(self.covariance, dtype=np.float64).reshape(-1, count) if count else np.zeros((0, 0))
        if matrix.shape != (count, count):
            raise ValueError(f"the covariance matrix must be {count} by {count}")
        sigma = np.array([item.sigma for item in self.estimated], dtype=np.float64)
        if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0) or not np.allclose(
            np.diagonal(matrix), sigma**2, rtol=1e-9
        ):
            raise ValueError("the covariance matrix is not symmetric or does not have the squares of the σ")
        return self

    def holds_in_one_flight(self, item: CalibratedParameter) -> bool:
        """Whether a parameter of the camera differs between flights."""
        return entity_kind(item.parameter) == "camera" and item.entity not in self.names

    @property
    def names(self) -> tuple[str, ...]:
        """The camera, and the other heads of its rig."""
        return self.camera.name, *(head.name for head in self.heads)

    @property
    def estimated(self) -> tuple[CalibratedParameter, ...]:
        """The parameters with a standard deviation, in the order of the covariance matrix."""
        return tuple(item for item in self.parameters if item.sigma is not None)

    @property
    def covariance_matrix(self) -> Floats:
        """(k, k) covariance matrix of the estimated parameters."""
        count = len(self.estimated)
        return np.array(self.covariance, dtype=np.float64).reshape(count, count)

    @property
    def text(self) -> str:
        """The record as JSON, always the same text for the same content."""
        return json_text(self.model_dump(mode="json"), indent=2)

    @property
    def digest(self) -> str:
        """sha256 of its content: what a registry stores and a certificate prints as verification code."""
        return hashlib.sha256(json_text(self.model_dump(mode="json")).encode()).hexdigest()
