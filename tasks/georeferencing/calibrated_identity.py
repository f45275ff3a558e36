"""Whether a calibration in a folder of results is one of the cameras it is to be applied to."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from tasks.errors import Location
from tasks.registry.identity import CameraBody, differences
from tasks.settings.direct_georeferencing import CalibrationInput
from tasks.tables.foreign import read_foreign_table
from tasks.tables.schemas.deliveries import CAMERAS

_REMEDY = "Name a folder with the results of `aerocal calibrate` or `aerocal adjust`; repeat older ones."


def refuse_other_cameras(source: CalibrationInput, cameras: pd.DataFrame) -> None:
    """Refuse results of another camera, image or mounting, by the test that the registry applies.

    A camera that the results do not know by its name is left to whoever looks for its values.

    Parameters
    ----------
    cameras : cameras.parquet of the project, those in use.

    Raises
    ------
    InputError
        Naming the first camera and everything that differs.
    """
    if source.cameras is None:
        raise ValueError("the calibration is not in the results of another run")
    table, _ = read_foreign_table(source.cameras, CAMERAS, _REMEDY, complete=True)
    recorded = {body.name: body for body in _bodies(table)}
    for body in _bodies(cameras):
        found = list(differences(recorded[body.name], body)) if body.name in recorded else []
        if found:
            raise Location(source.cameras, entity=f"cameras.{body.name}").error(
                f"The calibration is {', '.join(found)}; the project has {body.label}, {body.product}, "
                f"{body.image}, mounting {body.mounting}. None of it is applied.",
                f"Name a calibration of this camera, or correct cameras.{body.name} or its identity where "
                "one of the two projects has it wrong.",
            )


def _bodies(cameras: pd.DataFrame) -> Iterator[CameraBody]:
    for row in cameras.to_dict("records"):
        yield CameraBody.of_row({str(name): value for name, value in row.items()})
