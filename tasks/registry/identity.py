"""The subject of a calibration: the camera, and its mounting in the aircraft.

Both are compared as a whole and strictly. A number that one side gives and the other does not is a
difference: a calibration that might be of another camera is not applied.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from tasks.calibration.record import CalibratedCamera, CalibrationRecord
from tasks.files.json_text import JSON, json_text
from tasks.settings.camera_identity import CameraIdentity

if TYPE_CHECKING:
    from tasks.settings.cameras import CameraInput

_PRODUCTS = {"virtual_image": "virtual image", "camera_head": "camera head"}
# A null of a table is no text.
_NUMBERS = ("body", "lens", "imu", "mount", "band", "software")


@dataclass(frozen=True)
class CameraBody:
    """A camera and its image, with everything that a calibration depends on.

    Attributes
    ----------
    name : as its project calls it.
    identity : serial numbers.
    columns, rows, pixel_um : the image.
    mount_deg, calibration_axes_deg : see the settings of a camera.
    heads : of a rig those beside the reference head, which this is.
    is_head : whether it is mounted beside a reference head; then its mounting is that of the rig.
    """

    name: str
    identity: CameraIdentity
    columns: int
    rows: int
    pixel_um: float
    mount_deg: int
    calibration_axes_deg: int
    heads: tuple[CameraBody, ...] = ()
    is_head: bool = False

    @classmethod
    def of_calibration(cls, record: CalibrationRecord) -> CameraBody:
        """The camera or rig of a record."""
        return replace(cls.of_record(record.camera), heads=tuple(map(cls.of_record, record.heads)))

    @classmethod
    def of_record(cls, camera: CalibratedCamera) -> CameraBody:
        """The camera of a record."""
        return cls(**dict(camera))

    @classmethod
    def of_project(cls, name: str, camera: CameraInput) -> CameraBody:
        """A camera of a project file.

        Raises
        ------
        InputError
            If its camera file cannot be read.
        """
        # The formats of all deliveries: the registry itself reads none.
        from tasks.deliveries.cameras import camera_record

        image = camera_record(camera)
        return cls(
            name,
            camera.identity,
            image.columns,
            image.rows,
            image.pixel_um,
            camera.mount_deg,
            camera.calibration_axes_deg,
            is_head=camera.head is not None,
        )

    @classmethod
    def of_rig(cls, name: str, cameras: Mapping[str, CameraInput]) -> CameraBody:
        """The rig of a reference head, of all cameras of a project."""
        heads = (
            cls.of_project(other, camera)
            for other, camera in cameras.items()
            if camera.head is not None and camera.head.reference == name
        )
        return replace(cls.of_project(name, cameras[name]), heads=tuple(heads))

    @classmethod
    def of_row(cls, row: Mapping[str, Any]) -> CameraBody:
        """A camera from a row of cameras.parquet."""
        numbers = {name: text if isinstance(text := row.get(name), str) else None for name in _NUMBERS}
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
        """Key for counting versions: body, lens and product, or the name if neither number is known."""
        numbers: dict[str, JSON] = {"body": self.identity.body, "lens": self.identity.lens}
        named: dict[str, JSON] = {"name": self.name}
        known = numbers if any(numbers.values()) else named
        # What is not known is left out, so that older keys remain.
        more: dict[str, JSON] = {"band": self.identity.band, "software": self.identity.software}
        more["heads"] = sorted(key for key, _ in self.heads_by_key.items()) or None
        return json_text(
            {**known, "product": self.identity.product, **{k: v for k, v in more.items() if v is not None}}
        )

    @property
    def heads_by_key(self) -> Mapping[str, CameraBody]:
        """The other heads of a rig; those of which no number differs by their names."""
        keys = Counter(head.camera_key for head in self.heads)
        return {
            head.camera_key if keys[head.camera_key] == 1 else f"{head.camera_key} {head.name}": head
            for head in self.heads
        }

    @property
    def mounting_key(self) -> str:
        """Key of the mounting, to which boresight and lever arm belong."""
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
        """Body and lens in words, with band and software; empty if none is known."""
        identity = self.identity
        return _joined(
            ("body", identity.body),
            ("lens", identity.lens),
            ("band", identity.band),
            ("software", identity.software),
        )

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
        named = f"{self.name} with {len(self.heads)} heads" if self.heads else self.name
        return f"{named} ({self.numbers})" if self.numbers else named


def heads_of(record: CalibrationRecord, like: CalibrationRecord) -> Mapping[str, str]:
    """Name of each camera of a record → name of the same head in another record; empty: the reference head.

    Projects may call the heads differently; their numbers tell which is which.
    """
    names = {key: head.name for key, head in CameraBody.of_calibration(like).heads_by_key.items()}
    own = CameraBody.of_calibration(record).heads_by_key
    return {record.camera.name: "", **{head.name: names.get(key, head.name) for key, head in own.items()}}


def differences(recorded: CameraBody, camera: CameraBody) -> Iterator[str]:
    """Why a calibration of `recorded` is none of `camera`, the most serious reason first; empty if it is one.

    The one test for every way in which a calibration reaches a camera.
    """
    if recorded.identity.product != camera.identity.product:
        yield f"of a {recorded.product}, and this is a {camera.product}"
    elif bool(recorded.heads) != bool(camera.heads):
        yield "of a camera alone, not of a rig" if camera.heads else "of a rig with all its heads"
    elif other := tuple(_of_another(recorded.identity, camera.identity)):
        yield from other
    elif recorded.camera_key != camera.camera_key:
        there, here = recorded.numbers or "no numbers", camera.numbers or "none"
        yield f"of another camera ({there} there, {here} here)"
    if recorded.image != camera.image:
        yield f"of another image ({recorded.image})"
    heads = recorded.heads_by_key
    for key, head in camera.heads_by_key.items():
        if key in heads and heads[key].image != head.image:
            yield f"of another image of {head.name} ({heads[key].image})"
    # A head is mounted as the rig says.
    if not camera.is_head and recorded.mounting_key != camera.mounting_key:
        yield f"of another mounting ({recorded.mounting})"


def _of_another(recorded: CameraIdentity, identity: CameraIdentity) -> Iterator[str]:
    """Another band or version of the software, or one that only one side declares."""
    for name, words in (("band", "band"), ("software", "software version")):
        there, here = getattr(recorded, name), getattr(identity, name)
        if there is not None and here is not None and there != here:
            yield f"of another {words} ({there} there, {here} here)"
        elif there != here:
            side = "calibration" if there is None else "project"
            yield f"of {words} {there or here}, which the {side} does not declare (identity.{name})"


def _joined(*numbers: tuple[str, str | None]) -> str:
    return ", ".join(f"{word} {number}" for word, number in numbers if number is not None)
