"""The record of a radiometric examination: the basis of its certificate, and what a registry keeps."""

from __future__ import annotations

import hashlib
from datetime import date
from typing import Literal

from pydantic import BaseModel

from tasks.files.json_text import JSON, json_text

#: The certificate as a file for programs, whose ``record`` is of this kind.
FILE = "radiometric_certificate.json"
#: Change in known standard deviations beyond which a quantity has drifted, by chance once in 1,000 times.
LIMIT = 3.29


class RadiometricQuantity(BaseModel, frozen=True, extra="forbid"):
    """A figure of a band that can be compared with that of another date.

    Attributes
    ----------
    sigma : its standard deviation; None: of a number of defects, or not known.
    degrees_of_freedom : of sigma; None: it is known, or comes from an older version.
    """

    band: int
    quantity: str
    value: float
    sigma: float | None
    unit: str
    degrees_of_freedom: float | None = None


class RadiometricRecord(BaseModel, frozen=True, extra="allow"):
    """The record; its other content (digests of tables, settings, software) is kept unchanged.

    Attributes
    ----------
    camera : its name.
    body, lens : serial numbers.
    examined : date of the images.
    """

    camera: str
    body: str | None
    lens: str | None
    product: Literal["virtual_image", "camera_head"]
    examined: date | None
    verdict: Literal["accepted", "refused"]
    quantities: tuple[RadiometricQuantity, ...]

    @property
    def camera_key(self) -> str:
        """Key for counting versions: body, lens and product, or the name if neither number is known."""
        numbers: dict[str, JSON] = {"body": self.body, "lens": self.lens}
        known = numbers if any(numbers.values()) else {"name": self.camera}
        return json_text({**known, "product": self.product})

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the camera: its name, body and lens."""
        return tuple(name for name in (self.camera, self.body, self.lens) if name)

    @property
    def label(self) -> str:
        """Name and numbers."""
        numbers = [f"{word} {value}" for word, value in (("body", self.body), ("lens", self.lens)) if value]
        return f"{self.camera} ({', '.join(numbers)})" if numbers else self.camera


def digest_of(content: str) -> str:
    """Verification code of a record in its canonical spelling."""
    return hashlib.sha256(content.encode()).hexdigest()
