"""What a calibration is of: the camera, and its mounting in the aircraft.

Both are compared as a whole and strictly. A number that one side gives and the other does not is a
difference: a calibration that might be of another camera is not applied.
"""

from __future__ import annotations

from dataclasses import dataclass

from tasks.calibration.record import CalibratedCamera
from tasks.importing.cameras import camera_record
from tasks.settings.cameras import CameraIdentity, CameraInput
from tasks.storage.json_text import JSON, json_text

_PRODUCTS = {"virtual_image": "virtual image", "camera_head": "camera head"}


@dataclass(frozen=True)
class CameraBody:
    """A camera and its image as far as a calibration depends on them.

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
        """What people call it: its name, body and lens."""
        return tuple(name for name in (self.name, self.identity.body, self.identity.lens) if name)

    @property
    def label(self) -> str:
        """Name and numbers."""
        return f"{self.name} ({self.numbers})" if self.numbers else self.name


def _joined(*numbers: tuple[str, str | None]) -> str:
    return ", ".join(f"{word} {number}" for word, number in numbers if number is not None)
