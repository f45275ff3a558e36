"""A calibration.json as stored in a registry: checked, and in the canonical spelling of its digest."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from pydantic import ValidationError

from tasks.calibration.record import CalibrationRecord
from tasks.errors import InputError
from tasks.files.delivered_file import is_there, read_delivered
from tasks.files.json_text import JSON, from_json, json_text
from tasks.plain_text import trouble_in_tables
from tasks.registry.vouched import require_vouched

# One camera alone has the short name.
_FILES = ("calibration.json", "calibration_*.json")
_REMEDY = "Name the calibration.json that `aerocal calibrate` wrote, or its folder of results."


@dataclass(frozen=True)
class SealedRecord:
    """The content of a record, exactly the bytes of its digest.

    Attributes
    ----------
    content : JSON without line breaks, keys sorted.
    """

    content: str

    @classmethod
    def of(cls, record: CalibrationRecord) -> SealedRecord:
        """The sealed form of a new record."""
        return cls(json_text(record.model_dump(mode="json")))

    @property
    def digest(self) -> str:
        """sha256 of the content; what a certificate prints as verification code."""
        return hashlib.sha256(self.content.encode()).hexdigest()

    @cached_property
    def record(self) -> CalibrationRecord:
        """The record.

        Raises
        ------
        ValidationError
            If the content is none.
        """
        # No text for a number, no true for 1.
        return CalibrationRecord.model_validate_json(self.content, strict=True)


def has_calibration(folder: Path) -> bool:
    """Whether there is a calibration in a folder of results."""
    return folder.is_dir() and any(next(folder.glob(pattern), None) for pattern in _FILES)


def read_calibrations(place: Path, codes: Sequence[str] = ()) -> tuple[SealedRecord, ...]:
    """Read a record, or all records in a folder of results: one for each camera.

    Parameters
    ----------
    codes : verification codes of certificates, which vouch for records without their folder of results.

    Raises
    ------
    InputError
        If there is none, one of them is not a calibration, or nothing vouches for it.
    """
    if not (is_there(place) and place.is_dir()):
        return (_read(place, codes),)
    files = [file for pattern in _FILES for file in sorted(place.glob(pattern))]
    if not files:
        raise InputError("There is no calibration in this folder.", _REMEDY, file=place)
    return tuple(_read(file, codes) for file in files)


def _read(file: Path, codes: Sequence[str]) -> SealedRecord:
    delivered = read_delivered(file.resolve(), "document")
    sealed = _sealed(delivered, file)
    require_vouched(file, hashlib.sha256(delivered).hexdigest(), sealed.digest, codes)
    return sealed


def _sealed(delivered: bytes, file: Path) -> SealedRecord:
    try:
        # The file's own values, and not those of the model: its digest is that of whoever wrote it.
        content = from_json(delivered)
        _require_readable(content, file)
        sealed = SealedRecord(json_text(content))
        sealed.record  # noqa: B018
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "the record"
        raise InputError(
            f"This is not a calibration: {place}: {first['msg']}.", _REMEDY, file=file
        ) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"This is not JSON ({error}).", _REMEDY, file=file) from error
    return sealed


def _require_readable(content: JSON, file: Path) -> None:
    found = trouble_in_tables(content)
    if found is not None:
        place, trouble = found
        raise InputError(trouble, _REMEDY, file=file, entity=".".join(map(str, place)) or None)
