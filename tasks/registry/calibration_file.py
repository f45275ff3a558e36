"""A calibration.json as stored in a registry: checked, and in the canonical spelling of its digest.

What vouches for a calibration.json: manifest and certificate next to it, or the code on its certificate.

A record can be recomputed from the deliveries only. What is taken into a registry is therefore held against
what was written together with it: the digest of the file in manifest.json, and the verification code in
certificate.json. A file that comes alone has nothing next to it; then the code of its certificate, on
paper or by another way than the file, must be named. Whoever can write file, manifest and certificate can
forge all three: only `aerocal calibrate` from the deliveries, or the certificate that was signed, shows that.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from pydantic import ValidationError

from tasks.calibration.record import CalibrationRecord
from tasks.errors import InputError, Location
from tasks.files.delivered_file import is_there, read_delivered
from tasks.files.json_text import JSON, from_json, json_text
from tasks.plain_text import trouble_in_tables
from tasks.results.manifest import MANIFEST, published_entry

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
        raise Location(place).error("There is no calibration in this folder.", _REMEDY)
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
        raise Location(file).error(f"This is not a calibration: {place}: {first['msg']}.", _REMEDY) from error
    except (ValueError, RecursionError) as error:
        raise Location(file).error(f"This is not JSON ({error}).", _REMEDY) from error
    return sealed


def _require_readable(content: JSON, file: Path) -> None:
    found = trouble_in_tables(content)
    if found is not None:
        place, trouble = found
        raise Location(file, entity=".".join(map(str, place)) or None).error(trouble, _REMEDY)


# As the certificate prints it in the head of every page.
_LEAST_DIGITS = 16
_EDITED = "Use the unchanged folder written by `aerocal calibrate`, or calibrate again."


def require_vouched(file: Path, sha256: str, digest: str, codes: Sequence[str]) -> None:
    """Refuse a record that is not the one its manifest, its certificate or a named code refers to.

    Parameters
    ----------
    file : calibration.json, or that of one camera.
    sha256 : digest of its bytes.
    digest : of the record, which is the verification code of its certificate.
    codes : verification codes that were named, in any spelling, 16 digits or more.

    Raises
    ------
    InputError
        If one of them refers to another record, or nothing vouches for this one.
    """
    named = [code.lower().replace("-", "").rstrip("…") for code in codes]
    for code, spelt in zip(named, codes, strict=True):
        if len(code) < _LEAST_DIGITS:
            raise InputError(
                f"The verification code '{spelt}' has {len(code)} digits.",
                f"Give {_LEAST_DIGITS} or all 64 of the certificate.",
                entity="--code",
            )
    if named and not any(digest.startswith(code) for code in named):
        raise Location(file).error(
            f"The verification code of this calibration is {digest[:_LEAST_DIGITS]}…, not one of those "
            "given: it is a different calibration, or was changed after its certificate was written.",
            "Compare the code with the certificate, or request the file again.",
        )
    if not _published(file, sha256, digest) and not named:
        raise Location(file).error(
            "This calibration is not in a results folder, so its origin cannot be verified.",
            "Name the folder with manifest.json, or give the verification code of its certificate: --code.",
        )


def _published(file: Path, sha256: str, digest: str) -> bool:
    """Whether a manifest next to a file refers to it; whatever it says must fit."""
    entry = published_entry(file)
    if entry is None:
        return False
    if entry.sha256 != sha256:
        raise Location(file).error(
            f"This is not the file that was published: {MANIFEST} has the digest {entry.sha256[:12]}…, the "
            f"file {sha256[:12]}….",
            _EDITED,
        )
    certificate = file.with_name(file.name.replace("calibration", "certificate", 1))
    code = _code(certificate) if certificate.exists() else digest
    if code != digest:
        raise Location(file).error(
            f"The certificate next to it has the verification code {code[:_LEAST_DIGITS]}…, but this has "
            f"{digest[:_LEAST_DIGITS]}….",
            _EDITED,
        )
    return True


def _code(certificate: Path) -> str:
    try:
        content = from_json(read_delivered(certificate.resolve(), "document"))
    except (ValueError, RecursionError) as error:
        raise Location(certificate).error(f"This is not a certificate ({error}).", _EDITED) from error
    return str(content.get("code")) if isinstance(content, dict) else ""
