"""What a calibration is of: the camera, and its mounting in the aircraft.

Both are compared as a whole and strictly. A number that one side gives and the other does not is a
difference: a calibration that might be of another camera is not applied.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from tasks.calibration.record import CalibratedCamera
from tasks.deliveries.cameras import camera_record
from tasks.files.json_text import JSON, json_text
from tasks.settings.cameras import CameraIdentity, CameraInput

_PRODUCTS = {"virtual_image": "virtual image", "camera_head": "camera head"}
# A null of a table is no text.
_NUMBERS = ("body", "lens", "imu", "mount")


@dataclass(frozen=True)
class CameraBody:
    """A camera and its image, with everything that a calibration depends on.

    Attributes
    ----------
    name : as its project calls it.
    identity : serial numbers.
    columns, rows, pixel_um : the image.
    mount_deg, calibration_axes_deg : see the settings of a camera.
    """

    name: str
    identity: CameraIdentity
    columns: int
    rows: int
    pixel_um: float
    mount_deg: int
    calibration_axes_deg: int

    @classmethod
    def of_record(cls, camera: CalibratedCamera) -> CameraBody:
        """The camera a record is of."""
        return cls(
            camera.name,
            camera.identity,
            camera.columns,
            camera.rows,
            camera.pixel_um,
            camera.mount_deg,
            camera.calibration_axes_deg,
        )

    @classmethod
    def of_project(cls, name: str, camera: CameraInput) -> CameraBody:
        """A camera of a project file.

        Raises
        ------
        InputError
            If its camera file cannot be read.
        """
        image = camera_record(camera)
        return cls(
            name,
            camera.identity,
            image.columns,
            image.rows,
            image.pixel_um,
            camera.mount_deg,
            camera.calibration_axes_deg,
        )

    @classmethod
    def of_row(cls, row: Mapping[str, Any]) -> CameraBody:
        """A camera as a row of cameras.parquet has it."""
        numbers = {name: row[name] if isinstance(row[name], str) else None for name in _NUMBERS}
        return cls(
            str(row["camera"]),
            CameraIdentity(**numbers, product=row["product"]),
            int(row["columns"]),
            int(row["rows"]),
            float(row["pixel_um"]),
            int(row["mount_deg"]),
            int(row["calibration_axes_deg"]),
        )

    @property
    def camera_key(self) -> str:
        """What versions are counted by: body, lens and product, or the name if neither number is known."""
        numbers: dict[str, JSON] = {"body": self.identity.body, "lens": self.identity.lens}
        named: dict[str, JSON] = {"name": self.name}
        known = numbers if any(numbers.values()) else named
        return json_text({**known, "product": self.identity.product})

    @property
    def mounting_key(self) -> str:
        """What boresight and lever arm belong to."""
        identity = self.identity
        return json_text({"imu": identity.imu, "mount": identity.mount, "mount_deg": self.mount_deg})

    @property
    def image(self) -> str:
        """The image in words."""
        return (
            f"{self.columns} × {self.rows} px of {self.pixel_um:g} µm, calibration axes "
            f"{self.calibration_axes_deg}°"
        )

    @property
    def product(self) -> str:
        """The product in words."""
        return _PRODUCTS[self.identity.product]

    @property
    def numbers(self) -> str:
        """Body and lens in words; empty if neither is known."""
        return _joined(("body", self.identity.body), ("lens", self.identity.lens))

    @property
    def mounting(self) -> str:
        """The mounting in words."""
        known = _joined(("IMU", self.identity.imu), ("mount", self.identity.mount))
        # The usual angle needs no words beside numbers that say more.
        turned = f"κ_mount {self.mount_deg}°" if self.mount_deg or not known else ""
        return ", ".join(filter(None, (known, turned)))

    @property
    def names(self) -> tuple[str, ...]:
        """Its names: name, body and lens."""
        return tuple(name for name in (self.name, self.identity.body, self.identity.lens) if name)

    @property
    def label(self) -> str:
        """Name and numbers."""
        return f"{self.name} ({self.numbers})" if self.numbers else self.name


def differences(recorded: CameraBody, camera: CameraBody) -> Iterator[str]:
    """Why a calibration of `recorded` is none of `camera`, the most serious reason first; nothing: it is one.

    The one test for every way in which a calibration reaches a camera.
    """
    if recorded.identity.product != camera.identity.product:
        yield f"of a {recorded.product}, and this is a {camera.product}"
    elif recorded.camera_key != camera.camera_key:
        there, here = recorded.numbers or "no numbers", camera.numbers or "none"
        yield f"of another camera ({there} there, {here} here)"
    if recorded.image != camera.image:
        yield f"of another image ({recorded.image})"
    if recorded.mounting_key != camera.mounting_key:
        yield f"of another mounting ({recorded.mounting})"


def _joined(*numbers: tuple[str, str | None]) -> str:
    return ", ".join(f"{word} {number}" for word, number in numbers if number is not None)
