"""The contents of a registry, read in one state and checked against its history."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import date
from typing import cast

from tasks.calibration.record import CalibrationRecord
from tasks.errors import InputError
from tasks.nearest_name import did_you_mean
from tasks.registry.calibration_file import SealedRecord
from tasks.registry.history import Event, State, Validity
from tasks.registry.identity import CameraBody

_LEAST_DIGITS = 8
_PRODUCTS = (":virtual_image", ":camera_head")
_SHOWN = 3
_RESTORE = "Restore the registry from a backup; `aerocal registry verify` lists every inconsistency."


@dataclass(frozen=True)
class Finding:
    """Something in a registry that the registry did not write.

    Attributes
    ----------
    sentence : what does not fit.
    calibration : the record it concerns; None: it may concern any.
    """

    sentence: str
    calibration: int | None = None


@dataclass(frozen=True)
class StoredCalibration:
    """A record of the registry that fits its history.

    Attributes
    ----------
    id : number in this registry.
    version : number among the records of the same camera.
    sealed : its content.
    events : its history, at least one.
    """

    id: int
    version: int
    sealed: SealedRecord
    events: tuple[Event, ...]

    @property
    def record(self) -> CalibrationRecord:
        """The calibration."""
        return self.sealed.record

    @property
    def camera(self) -> CameraBody:
        """The camera it describes."""
        return CameraBody.of_calibration(self.record)

    @property
    def state(self) -> State:
        """draft, approved or superseded."""
        return cast(State, self.events[-1].state)

    @property
    def validity(self) -> Validity | None:
        """Days on which it is valid; None: none (any more)."""
        return self.events[-1].validity

    @property
    def approval(self) -> Event | None:
        """The event that approved it."""
        return next((event for event in self.events if event.state == "approved"), None)

    @property
    def flown(self) -> date | None:
        """Date of its flight."""
        return self.record.flight.flown

    @property
    def standing(self) -> str:
        """Its validity, who approved it, and objections, stated wherever it is used."""
        approval, verdict = self.approval, self.record.verdict
        by = f", approved by {approval.person} on {approval.at[:10]}" if approval is not None else ""
        against = ""
        if verdict == "refused" and approval is not None:
            against = (
                f"; it was refused by the acceptance test and approved with the reason: {approval.although}"
            )
        elif verdict == "restricted":
            against = f"; accepted with restrictions: {' '.join(self.record.restrictions)}"
        return f"valid {self.validity}{by}{against}"

    @property
    def label(self) -> str:
        """Its name in sentences."""
        return f"calibration {self.id} ({self.record.camera.name}, version {self.version})"


@dataclass(frozen=True)
class Contents:
    """Everything in a registry.

    Attributes
    ----------
    calibrations : the records that fit their history, by id.
    findings : what does not fit.
    events : the whole history.
    """

    calibrations: tuple[StoredCalibration, ...]
    findings: tuple[Finding, ...]
    events: tuple[Event, ...]

    @property
    def digest(self) -> str:
        """Digest of the last event: the whole state in one number; empty without any."""
        return self.events[-1].digest if self.events else ""

    def require_sound(self, calibrations: Iterable[int] = ()) -> None:
        """Refuse to continue if the history as a whole, or one of these records, was edited.

        Raises
        ------
        InputError
            Naming which record, and what does not fit.
        """
        concerned = {None, *calibrations}
        self._refuse([finding for finding in self.findings if finding.calibration in concerned])

    def require_untouched(self) -> None:
        """Refuse to continue if anything was edited: nothing is added to doubtful content.

        Raises
        ------
        InputError
            Naming which record, and what does not fit.
        """
        self._refuse(self.findings)

    def _refuse(self, findings: Sequence[Finding]) -> None:
        found = [finding.sentence for finding in findings]
        if found:
            more = f" And {len(found) - _SHOWN} more." if len(found) > _SHOWN else ""
            raise InputError("The registry was edited: " + " ".join(found[:_SHOWN]) + more, _RESTORE)

    def calibration(self, text: str) -> StoredCalibration:
        """The record with this id or beginning of its digest.

        Raises
        ------
        InputError
            If there is none, or it was edited.
        """
        found = self._by_number(text) or self._by_digest(text)
        number = found.id if found is not None else int(text) if text.isdecimal() else None
        self.require_sound(() if number is None else (number,))
        if found is None:
            known = ", ".join(str(item.id) for item in self.calibrations[-12:])
            raise InputError(
                f"There is no calibration '{text}' in the registry.",
                f"Known are: {known}; `aerocal registry list` shows them." if known else "It is empty.",
            )
        return found

    def of_camera(self, text: str) -> tuple[StoredCalibration, ...]:
        """The records of the camera with this name, body or lens, oldest first.

        Parameters
        ----------
        text : name or number, with ":camera_head" or ":virtual_image" where both exist.

        Raises
        ------
        InputError
            If there is none, or the text fits several cameras, or the history was edited.
        """
        self.require_sound()
        name, _, product = text.rpartition(":") if text.endswith(_PRODUCTS) else (text, "", "")
        found = tuple(
            item
            for item in self.calibrations
            if name in item.camera.names and product in ("", item.camera.identity.product)
        )
        each = {item.camera.camera_key: item for item in found}
        if not found:
            known = dict.fromkeys(known for item in self.calibrations for known in item.camera.names)
            raise InputError(f"There is no calibration of a camera '{name}'.", did_you_mean(name, known))
        if len(each) > 1:
            several = "; ".join(f"{item.id}: {item.camera.label}" for item in each.values())
            raise InputError(
                f"'{text}' matches {len(each)} cameras.",
                f"Use another serial number, or add {' or '.join(_PRODUCTS)}, or name one calibration ("
                f"{several}).",
            )
        # Also those in which the camera has another name.
        return self.sisters(found[0].camera)

    def sisters(self, camera: CameraBody) -> tuple[StoredCalibration, ...]:
        """The records of the same camera, oldest first."""
        return tuple(item for item in self.calibrations if item.camera.camera_key == camera.camera_key)

    def _by_number(self, text: str) -> StoredCalibration | None:
        if not text.isdecimal():
            return None
        return next((item for item in self.calibrations if item.id == int(text)), None)

    def _by_digest(self, text: str) -> StoredCalibration | None:
        # As a certificate prints it: in groups of capitals.
        beginning = text.lower().replace("-", "").rstrip("…")
        found = [item for item in self.calibrations if item.sealed.digest.startswith(beginning)]
        return found[0] if len(found) == 1 and len(beginning) >= _LEAST_DIGITS else None
