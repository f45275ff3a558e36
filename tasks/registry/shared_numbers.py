"""Calibrations that count as those of one camera, although they name or describe two."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from tasks.registry.contents import StoredCalibration
from tasks.registry.identity import CameraBody

_DESCRIBED: tuple[tuple[str, Callable[[CameraBody], str]], ...] = (
    ("are of the camera", lambda camera: f"'{camera.name}'"),
    ("are of an image of", lambda camera: camera.image),
)


def shared_numbers(items: Sequence[StoredCalibration]) -> Iterator[str]:
    """Sentences that two cameras may have one serial number; none if all name and describe one camera.

    Parameters
    ----------
    items : the calibrations of one camera, by its numbers; where it has none, by its name.
    """
    for words, described in _DESCRIBED:
        ids: dict[str, list[str]] = {}
        for item in items:
            ids.setdefault(described(item.camera), []).append(str(item.id))
        if len(ids) > 1:
            camera = items[-1].camera
            found = "; ".join(f"{', '.join(of)} {words} {what}" for what, of in ids.items())
            yield (
                f"Calibrations {found}. All count as those of one camera ({camera.numbers or camera.name}): "
                "they are compared, and an approval supersedes earlier ones. If there are two cameras, "
                f"correct cameras.{camera.name}.identity and calibrate again."
            )
