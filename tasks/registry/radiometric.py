"""Radiometric examinations in a registry, beside the calibrations: what they found, and what has changed.

They are not approved, for no project applies them. Each row is sealed by a digest over its values and the
seal of the row before it, so that a change, a removal or an insertion shows; the last seal stands in a row of
its own.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from tasks.document_kit.table import Number, decimals_for
from tasks.errors import Location
from tasks.files.delivered_file import is_there, read_delivered
from tasks.files.json_text import JSON, from_json, json_text
from tasks.image_quality.radiometric_record import FILE, LIMIT, RadiometricRecord, digest_of
from tasks.plain_text import trouble_in_tables
from tasks.registry.history import BEGINNING
from tasks.results.manifest import MANIFEST, published_entry

_REMEDY = "Name the results folder of `aerocal image-quality`."


@dataclass(frozen=True)
class RadiometricResult:
    """A row of the registry.

    Attributes
    ----------
    id : 1, 2, … over the registry.
    version : number among those of the same camera.
    content : the record, JSON in its one spelling.
    person, at, note : who added it, when (UTC), and what that person had to say.
    previous : seal of the row before; zeros before the first one.
    seal : digest of all this.
    """

    id: int
    version: int
    content: str
    person: str
    at: str
    note: str
    previous: str = BEGINNING
    seal: str = ""

    @cached_property
    def record(self) -> RadiometricRecord:
        """The stored record."""
        return RadiometricRecord.model_validate_json(self.content)

    @property
    def digest(self) -> str:
        """Verification code, as its certificate prints it."""
        return digest_of(self.content)

    @property
    def expected_seal(self) -> str:
        """The seal of its values."""
        values: dict[str, JSON] = {k: v for k, v in asdict(self).items() if k != "seal"}
        return hashlib.sha256(json_text(values).encode()).hexdigest()


def read_radiometric(place: Path) -> str | None:
    """The record of a folder of results, or of its certificate's JSON; None: there is none.

    Raises
    ------
    InputError
        If the certificate is not the one that was published, or its record not the one of its code.
    """
    file = place / FILE if is_there(place) and place.is_dir() else place
    if file.name != FILE or not is_there(file):
        return None
    delivered = read_delivered(file.resolve(), "document")
    _require_published(file, hashlib.sha256(delivered).hexdigest())
    try:
        twin = from_json(delivered)
        record = twin["record"] if isinstance(twin, dict) else None
        content = json_text(record)
        RadiometricRecord.model_validate_json(content)
    except (ValueError, KeyError, RecursionError, ValidationError) as error:
        raise Location(file).error("This is not a radiometric certificate.", _REMEDY) from error
    found = trouble_in_tables(record)
    if found is not None:
        raise Location(file).error(found[1], _REMEDY)
    if not isinstance(twin, dict) or twin.get("code") != digest_of(content):
        raise Location(file).error(
            "The verification code of the certificate is not that of its record: one of them was changed.",
            _REMEDY,
        )
    return content


def _require_published(file: Path, sha256: str) -> None:
    entry = published_entry(file)
    if entry is None or entry.sha256 != sha256:
        raise Location(file).error(
            f"This is not the file that was published: it does not agree with {MANIFEST}.", _REMEDY
        )


def findings(rows: Sequence[RadiometricResult], head: Mapping[str, Any] | None) -> Iterator[str]:
    """Rows, in the order of their numbers, that the registry did not write."""
    before = BEGINNING
    for place, row in enumerate(rows, start=1):
        name = f"Radiometric result {row.id}"
        if row.seal != row.expected_seal:
            yield f"{name}: its values do not match its seal; one of them was changed."
        if row.id != place or row.previous != before:
            yield (
                f"{name}: the sequence of results is broken here; one was changed, removed, inserted "
                "or moved."
            )
        before = row.seal
    counted, seal = (0, BEGINNING) if head is None else (head["results"], head["seal"])
    if counted != len(rows) or seal != before:
        yield f"The registry has counted {counted} radiometric results, but there are {len(rows)}."


@dataclass(frozen=True)
class QuantityChange:
    """Change of a quantity of a band from one result to the next.

    Attributes
    ----------
    sigma : of the change; of numbers of defects √(then + now), too large rather than too small.
    t : change / sigma; NaN if it has none.
    critical : of |t|, beyond which the quantity has drifted.
    """

    band: int
    quantity: str
    unit: str
    then: float
    now: float
    sigma: float
    t: float
    critical: float = LIMIT

    @property
    def drifted(self) -> bool:
        """Whether its standard deviation does not explain it."""
        return abs(self.t) > self.critical

    @property
    def sentence(self) -> str:
        """The change in words."""
        unit, words = f" {self.unit}" if self.unit else "", self.quantity.replace("_", " ")
        decimals = 0 if self.quantity.startswith("defect") else decimals_for(self.sigma)
        then, now, sigma = (Number(value, decimals) for value in (self.then, self.now, self.sigma))
        change, t = Number(self.now - self.then, decimals, plus=True), Number(self.t, 1, plus=True)
        return f"{words} of band {self.band}: {then} to {now}{unit}, {change} ± {sigma} ({t} σ)"


def changes(then: RadiometricRecord, now: RadiometricRecord) -> tuple[QuantityChange, ...]:
    """Every quantity that both have, and whose change can be tested."""
    # Loaded where results are compared alone: it needs scipy.
    from adjust.image_quality.change import critical_change

    before = {(one.band, one.quantity): one for one in then.quantities}
    found = []
    for one in now.quantities:
        old = before.get((one.band, one.quantity))
        if old is None:
            continue
        critical = LIMIT
        if one.quantity.startswith("defect"):
            sigma = float(np.sqrt(max(old.value + one.value, 1.0)))
        elif one.sigma is None or old.sigma is None:
            continue
        else:
            sigma = float(np.hypot(one.sigma, old.sigma))
            degrees = [
                np.inf if of.degrees_of_freedom is None else of.degrees_of_freedom for of in (one, old)
            ]
            critical = float(critical_change(np.array([[one.sigma, old.sigma]]), np.array([degrees]))[0])
        t = (one.value - old.value) / sigma if sigma > 0.0 else float("nan")
        found.append(
            QuantityChange(one.band, one.quantity, one.unit, old.value, one.value, sigma, t, critical)
        )
    return tuple(found)
