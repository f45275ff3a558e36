"""Write docs/project-file.md from the settings themselves: ``python -m docs.generate.settings``.

The page cannot be out of date: a test compares the committed file with what this module writes.
"""

from __future__ import annotations

import sys
import types
import typing
from collections.abc import Iterator, Mapping
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal, Union

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from tasks.settings.adjustment import (
    AdjustmentSettings,
    OwnObservationsInput,
    Priors,
    Rejection,
    ResidualGridSettings,
    SelfCalibrationSettings,
)
from tasks.settings.base import Settings, meaning_of
from tasks.settings.burn_in import BurnInSettings
from tasks.settings.calibration import AcceptanceLimits, CalibrationSettings, HeldSigmas, MountingSettings
from tasks.settings.camera_identity import CameraIdentity
from tasks.settings.cameras import CameraInput, CcdTiles, HeadSettings
from tasks.settings.certificate import CertificateSettings, Laboratory, Signatory
from tasks.settings.coordinates import Angles, Heights, LinearAlteration
from tasks.settings.deliver import DeliverSettings
from tasks.settings.direct_georeferencing import CalibrationInput, DirectGeoreferencingSettings
from tasks.settings.image_quality import ExposureLevel, ImageQualitySettings, MotionSettings, SensorSettings
from tasks.settings.inputs import (
    ControlInput,
    DeliveredFlight,
    DistancesInput,
    ExposureSigma,
    ExposuresInput,
    ImagePointsInput,
    Inputs,
    MapAdjustment,
)
from tasks.settings.project import Project, ProjectSettings
from tasks.settings.quality import AxisGate, ChecksSettings, Gate, Gates
from tasks.settings.statement import StatementSettings
from tasks.settings.sweep import BlockSelection, ControlScenario, SweepSettings
from tasks.settings.table_layout import StripRule, TableSettings
from tasks.settings.trajectory import EventsInput, TrajectoryInput
from tasks.settings.trust_map import TrustMapSettings

_TABLES: tuple[tuple[str, type[Settings], str], ...] = (
    ("project file", Project, "The top level."),
    ("[project]", ProjectSettings, ""),
    (
        "heights",
        Heights,
        'A height system, as value of any `heights`: `"ellipsoidal"`, or a table with these keys.',
    ),
    ("heights.linear_alteration", LinearAlteration, ""),
    (
        "[cameras.NAME]",
        CameraInput,
        "Either `file` and `format`, or the five values that describe the image.",
    ),
    ("cameras.NAME.tiles", CcdTiles, ""),
    ("[cameras.NAME.head]", HeadSettings, ""),
    ("cameras.NAME.identity", CameraIdentity, ""),
    ("[inputs]", Inputs, "`[inputs.KIND]` for one file, `[[inputs.KIND]]` for each of several."),
    ("[inputs.image_points]", ImagePointsInput, ""),
    ("[inputs.exposures]", ExposuresInput, ""),
    ("inputs.exposures.angles", Angles, ""),
    ("inputs.exposures.adjusted_in", MapAdjustment, ""),
    ("inputs.exposures.sigma", ExposureSigma, ""),
    ("[inputs.exposures.flights.NAME]", DeliveredFlight, ""),
    ("[inputs.exposures.trajectory]", TrajectoryInput, ""),
    ("[inputs.exposures.events]", EventsInput, "With the keys of [tables of others](#tables-of-others)."),
    ("[inputs.control]", ControlInput, ""),
    ("[inputs.distances]", DistancesInput, ""),
    ("inputs.exposures.strip", StripRule, ""),
    ("tables of others", TableSettings, ""),
    ("[adjustment]", AdjustmentSettings, ""),
    ("adjustment.rejection", Rejection, ""),
    ("[adjustment.self_calibration]", SelfCalibrationSettings, ""),
    ("[adjustment.residual_grid]", ResidualGridSettings, ""),
    ("[[adjustment.own_observations]]", OwnObservationsInput, ""),
    (
        "[adjustment.priors]",
        Priors,
        "An estimated parameter without a prior is determined by the other observations alone. A prior of a "
        "parameter that is held fixed has no effect.",
    ),
    ("[calibration]", CalibrationSettings, ""),
    ("[calibration.mounting]", MountingSettings, ""),
    ("[calibration.held]", HeldSigmas, ""),
    ("[calibration.limits]", AcceptanceLimits, ""),
    ("[burn_in]", BurnInSettings, "Explained in [rigs](rigs.md#burn-in-protocol)."),
    ("[direct_georeferencing]", DirectGeoreferencingSettings, ""),
    (
        "direct_georeferencing.calibration",
        CalibrationInput,
        'Usually a text: `"cameras"`, `"adjustment"` or a result folder; it is short for these keys.',
    ),
    ("[checks]", ChecksSettings, ""),
    (
        "[trust_map]",
        TrustMapSettings,
        "The table alone, even empty, switches it on ([what it shows](theory/trust-map.md)). A change of "
        "cells or σ adjusts the block again.",
    ),
    ("[gates]", Gates, "Only the given gates are tested."),
    ("gates.sigma0, gates of y-parallaxes and of the trust map", Gate, ""),
    ("the other gates", AxisGate, ""),
    (
        "[certificate]",
        CertificateSettings,
        "For `aerocal calibrate`. Missing entries appear as blank lines, to be filled in by hand.",
    ),
    ("[certificate.laboratory]", Laboratory, ""),
    ("[[certificate.signatories]]", Signatory, "One table for each signatory."),
    (
        "[[deliver]]",
        DeliverSettings,
        "One table for each delivery. A delivery that is refused, because the program would be wrong by a "
        "pixel or more, counts as a failed gate.",
    ),
    (
        "[[statement]]",
        StatementSettings,
        "One table for each [statement about accuracy](statements.md).",
    ),
    ("[sweep]", SweepSettings, ""),
    ("[sweep.blocks.NAME]", BlockSelection, ""),
    ("[sweep.control.NAME]", ControlScenario, ""),
    (
        "[image_quality]",
        ImageQualitySettings,
        "For `aerocal image-quality` ([what it measures](image-quality.md)); may be a separate file that "
        "contains only `version = 1` in addition.",
    ),
    ("[image_quality.motion]", MotionSettings, "Movement of the images during their exposure."),
    ("[image_quality.sensor]", SensorSettings, ""),
    ("[[image_quality.sensor.series]]", ExposureLevel, "One table for each exposure."),
)

_OPENING = """\
# The project file

*Written by `python -m docs.generate.settings` from the settings themselves; edit the descriptions
there.*

A project is described by one TOML file. It states which files are read, what their numbers mean, what is to
be estimated, and which limits the results must meet. Every key is checked. An unknown key is an error; the
message names the most similar known key.

- **Paths** are relative to the project file. `${NAME}` is replaced by the value of an environment variable. A
  path that does not exist there is also looked up in the folder given by `--data`.
- **Coordinates** are x = east, y = north, z = up in every input, regardless of the axis order of the CRS.
- **CRS, heights, angles and position reference** are declared for each input, because deliveries mix them.
  They have no default: a wrong guess would cause errors of metres that no message reveals.
- **Standard deviations** are in the unit of their quantity. The value of a row takes precedence over that of
  the input, and this over the default.
- Names of keys end with the unit (`_m`, `_mm`, `_um`, `_deg`, `_px`), unless another key declares it.
- On the command line, `--set a.b.c=VALUE` replaces one value. VALUE is read as TOML, otherwise as text.
  Tables in an array are addressed by their number (`inputs.image_points.0.sigma=0.3`).

If a key changes, only the affected stages are repeated, because each stage reads only its own tables. A new
gate repeats nothing, a new `adjustment` repeats the adjustment, and a file that was moved but not changed
repeats nothing.

A complete example is
[examples/ign_ultracam_eagle/project.toml](../examples/ign_ultracam_eagle/project.toml).
"""


def project_file_page() -> str:
    """The whole page as Markdown."""
    return (
        "\n".join([_OPENING, *(line for table in _TABLES for line in settings_section(*table))]).rstrip()
        + "\n"
    )


def settings_section(title: str, model: type[Settings], remark: str = "") -> Iterator[str]:
    """Lines of the section on one table: heading, a remark or the model's own sentence, and its keys."""
    yield f"## `{title}`" if title[0] in "[ahi" and " " not in title else f"## {title.capitalize()}"
    yield ""
    yield remark or (model.__doc__ or "").split("\n")[0]
    yield ""
    yield "| key | value | default | meaning |"
    yield "|---|---|---|---|"
    for name, field in model.model_fields.items():
        if (
            issubclass(model, TableSettings)
            and model is not TableSettings
            and name in TableSettings.model_fields
        ):
            continue
        meaning = meaning_of(model, name).replace("|", "\\|")
        yield f"| `{name}` | {_kind(field.annotation, field)} | {_default(field)} | {meaning} |"
    yield ""


def _kind(annotation: Any, field: FieldInfo | None = None) -> str:
    """The kind of value in words."""
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Annotated:
        return _kind(arguments[0])
    if origin in (Union, types.UnionType):
        return " or ".join(_kind(item) for item in arguments if item is not type(None))
    if origin is Literal:
        return ", ".join(f"`{_toml(value)}`" for value in arguments)
    if origin is tuple:
        return _tuple_kind(arguments)
    if origin is dict:
        return "tables"
    if origin is Mapping:
        return "table"
    if isinstance(annotation, type) and issubclass(annotation, Settings):
        from_text = (Heights, Rejection, CalibrationInput, StripRule)
        return "text or table" if annotation in from_text else "table"
    if field is not None and annotation is Path:
        return "path"
    names = {
        str: "text",
        float: "number",
        int: "whole number",
        Path: "path",
        bool: "true, false",
        date: "date",
    }
    return names[annotation]


def _tuple_kind(arguments: tuple[Any, ...]) -> str:
    if arguments[-1] is Ellipsis:
        inner = _kind(arguments[0])
        return "table, or array of tables" if inner == "table" else f"list of {inner}"
    kind = "paths" if _kind(arguments[0]) == "path" else "numbers"
    return {2: "two", 3: "three", 4: "four"}[len(arguments)] + f" {kind}"


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "**required**"
    value = field.default
    if isinstance(value, CalibrationInput):
        return '`"cameras"`'
    if value is PydanticUndefined or isinstance(value, Settings):
        return "see its table"
    if value is None or value == () or isinstance(value, dict):
        return "–"
    return f"`{_toml(value)}`"


def _toml(value: object) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return str(value)


def main() -> None:
    """Write the page into docs/ of the repository the command is run in, or to the path given."""
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/project-file.md")
    target.write_text(project_file_page(), encoding="utf-8")


if __name__ == "__main__":
    main()
