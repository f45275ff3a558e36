"""Lines of the project file: values with comments, and those on CRS and camera of positions.

Positions are those of exposures, control and trajectories.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np
import pyarrow as pa

from tasks.files.toml_text import TomlValue, toml_key, toml_value
from tasks.formats.records import FileStatement
from tasks.inventory.cameras import CameraSection
from tasks.plain_text import quoted, visible
from tasks.settings.coordinates import LOCAL
from tasks.settings.declare import open_value

_LONGEST = 300
#: What is asked where the file does not say it.
HEIGHTS = "'ellipsoidal', or { geoid = 'FILE.tif' }"
POSITION = "projection_centre, antenna or imu"
STRIP = "'time-gaps', or { pattern = '{strip}_*' } after the names of the images"
IN_MAP = "of x and y, e.g. 'EPSG:25832' (or 'local'); x is east and y is north"
ON_EARTH = "the datum of longitude and latitude, e.g. 'EPSG:4258' for ETRS89"


def key_line(key: str, value: object, why: str = "") -> str:
    """``key = value  # why``."""
    line = f"{toml_key(key)} = {toml_value(cast(TomlValue, value))}"
    return f"{line}  {comment(why)}" if why else line


def table_line(*keys: str) -> str:
    """``[a.b]``."""
    return f"[{'.'.join(map(toml_key, keys))}]"


def comment(text: str) -> str:
    """``# text``; what files say must not begin another line."""
    return f"# {visible(text, _LONGEST)}"


def place_lines(
    states: FileStatement, position: np.ndarray, counts: str, asked: str = IN_MAP, beside: str | None = None
) -> Iterator[str]:
    """CRS and heights of positions (n, 3), with their ranges above.

    Parameters
    ----------
    asked : what a person declares where the file states no CRS.
    beside : the CRS of a file ``.prj`` of the same name.
    """
    yield comment(
        f"{counts}: {', '.join(f'{n} {value_range(p)}' for n, p in zip('xyz', position.T, strict=True))}"
    )
    if states.crs is not None and "+ellps" not in states.crs:
        yield key_line("crs", states.crs, "as the file states it")
    elif states.crs is not None:
        # An ellipsoid is not a datum: between such systems nothing can be transformed.
        datum = f", datum {states.datum}" if states.datum else ""
        yield key_line("crs", open_value(f"its EPSG code; the file states {states.crs}{datum}"))
    elif beside is not None:
        yield key_line("crs", beside, "as the .prj of the same name states it")
    else:
        datum = f"; the file states the datum {quoted(states.datum)}" if states.datum else ""
        yield key_line("crs", open_value(asked + datum))
    if states.crs == LOCAL:
        return
    if states.heights is not None:
        yield key_line("heights", states.heights, "as the file states it")
    else:
        yield key_line("heights", open_value(HEIGHTS))


def camera_lines(camera: pa.Array, cameras: Sequence[CameraSection]) -> Iterator[str]:
    """The camera of a file whose rows (n,) name none: the only one there is, otherwise to be declared."""
    if camera.null_count == len(camera):
        value = cameras[0].name if len(cameras) == 1 else open_value("name of the camera of this file")
        yield key_line("camera", value)


def value_range(values: np.ndarray) -> str:
    """The smallest and largest of numbers, some of which may not be known."""
    known = values[np.isfinite(values)]
    return f"{known.min():.10g} to {known.max():.10g}" if len(known) else "not given"
