"""The calibration that applies to a camera on the day of a flight, or similar ones and why they do not.

Everything must be the same: camera (body and lens, or the name where neither is known), product, image, and
mounting. A number that only one side gives is a difference: a calibration that may be that of another camera
is not applied, but named.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import date

from tasks.errors import InputError
from tasks.registry.contents import Contents, StoredCalibration
from tasks.registry.identity import CameraBody, differences

_SHOWN = 4


def chosen_calibration(contents: Contents, camera: CameraBody, flown: date) -> StoredCalibration:
    """The approved calibration that applies to a camera on a day.

    Raises
    ------
    InputError
        If there is none; it names those that are near. If the registry was edited.
    """
    contents.require_untouched()
    fitting = [item for item in contents.calibrations if not list(_differences(item, camera, flown))]
    if fitting:
        # Approving takes care that there is one; the younger one would supersede the older.
        return fitting[-1]
    near = [item for item in contents.calibrations if _is_near(item.camera, camera)]
    said = [(list(_differences(item, camera, flown)), item) for item in near]
    said.sort(key=lambda entry: (len(entry[0]), -entry[1].id))
    listed = "; ".join(f"{item.id} ({item.camera.label}): {', '.join(d)}" for d, item in said[:_SHOWN])
    more = f"; and {len(said) - _SHOWN} more" if len(said) > _SHOWN else ""
    raise InputError(
        f"The registry has no approved calibration of {camera.label}, {camera.product}, mounting "
        f"{camera.mounting}, for a flight on {flown}."
        + (f" Similar: {listed}{more}." if listed else " It contains none for such a camera."),
        "Approve one for this day (`aerocal registry approve`), or correct cameras.NAME.identity or "
        "project.flown.".replace("NAME", camera.name),
        entity=f"cameras.{camera.name}",
    )


def _differences(item: StoredCalibration, camera: CameraBody, flown: date) -> Iterator[str]:
    """Why a record does not apply, in words, the most serious reason first."""
    yield from differences(item.camera, camera)
    if item.state == "draft":
        yield "not approved yet"
    elif item.validity is None:
        yield f"superseded by {item.events[-1].successor}"
    elif not item.validity.contains(flown):
        yield f"valid {item.validity}"


def _is_near(one: CameraBody, other: CameraBody) -> bool:
    """Whether two cameras have a name or number in common."""
    a, b = one.identity, other.identity
    same_number = any(x is not None and x == y for x, y in ((a.body, b.body), (a.lens, b.lens)))
    return same_number or one.name == other.name
