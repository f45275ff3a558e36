"""Tables and figures of a two-step calibration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.calibration.offset_separation import OffsetSeparation
from adjust.calibration.orientation_differences import COMPONENTS, misalignment_angles
from adjust.calibration.two_step import GroupMean, TwoStep
from tasks.calibration.offset_words import offset_sentence
from tasks.calibration.orientation_pairs import CameraDifferences
from tasks.files.json_text import JSON, attributes
from tasks.results.calibration_figures import TwoStepFigure

# Radians are shown in degrees.
_SHOWN = np.array([np.rad2deg(1.0)] * 3 + [1.0] * 6)
_UNITS = ("deg",) * 3 + ("m",) * 6


def difference_columns(item: CameraDifferences, result: TwoStep) -> pd.DataFrame:
    """Rows of orientation_differences.parquet."""
    shown = item.differences.components * _SHOWN
    strip = np.searchsorted(result.strips.strip, item.differences.strip)
    columns: dict[str, Any] = {
        "image": item.image,
        "camera": item.camera,
        "strip": [item.strip_names[i] for i in item.differences.strip],
        "place": item.differences.place,
        "heading_deg": np.rad2deg(item.differences.heading) % 360.0,
        "mounting": result.mountings.mounting[strip],
        "height_m": item.differences.height,
    }
    columns |= {f"{n}_{u}": v for n, u, v in zip(COMPONENTS, _UNITS, shown.T, strict=True)}
    columns |= {f"weight_{n}": v for n, v in zip(COMPONENTS, result.weight.T, strict=True)}
    return pd.DataFrame(columns)


def mean_columns(item: CameraDifferences, result: TwoStep) -> pd.DataFrame:
    """Rows of orientation_difference_means.parquet: groups of strips, then the single strips."""
    groups = pd.concat([_group_rows(item, group) for group in result.groups])
    return pd.concat([groups, _strip_rows(item, result)]).assign(camera=item.camera)


def _group_rows(item: CameraDifferences, group: GroupMean) -> pd.DataFrame:
    mean = group.mean
    name = {
        "all": "all",
        "mounting": str(group.number),
        "flight": item.flight_names[group.number] if group.scope == "flight" else "",
        "heading": f"{round(float(np.rad2deg(group.heading))) % 360} deg",
        "height": f"{group.height:.0f} m",
    }[group.scope]
    rows = _rows(group.scope, name, group.images, group.strips, group.heading, group.height)
    if group.mounting >= 0:
        rows = rows.assign(mounting=pd.array([group.mounting] * 9, dtype="Int32"))
    return rows.assign(
        value_plain=_in_units(mean.plain),
        sigma_plain=mean.plain_sigma * _SHOWN,
        value=_in_units(mean.robust),
        sigma=group.sigma * _SHOWN,
        freedom=group.freedom,
        sigma_adjusted=group.known * _SHOWN,
        rms=mean.rms * _SHOWN,
        between_strips=group.between * _SHOWN,
    )


def _strip_rows(item: CameraDifferences, result: TwoStep) -> pd.DataFrame:
    strips, tables = result.strips, []
    # The offset is tested in one of the two axes only.
    mountings = result.mountings
    tested = np.hstack([mountings.outlying, np.zeros((len(strips.strip), 3), dtype=bool)])
    if mountings.tested_axes == "map":
        tested[:, 6:], tested[:, 3:6] = tested[:, 3:6].copy(), False
    for k, strip in enumerate(strips.strip):
        name = item.strip_names[strip]
        heading, height = float(strips.heading[k]), float(strips.height[k])
        tables.append(
            _rows("strip", name, int(strips.count[k]), 1, heading, height).assign(
                value=_in_units(strips.mean[k]),
                sigma=strips.sigma[k] * _SHOWN,
                rms=strips.scatter[k] * _SHOWN,
                drift=strips.drift[k] * _SHOWN,
                sigma_drift=strips.drift_sigma[k] * _SHOWN,
                mounting=pd.array([mountings.mounting[k]] * 9, dtype="Int32"),
                outlying=pd.array(tested[k], dtype="boolean") if mountings.tested else _untested(),
            )
        )
    return pd.concat(tables)


def _rows(scope: str, name: str, images: int, strips: int, heading: float, height: float) -> pd.DataFrame:
    rows = pd.DataFrame({"component": COMPONENTS, "unit": _UNITS})
    rows = rows.assign(scope=scope, group=name, images=images, strips=strips, height_m=height)
    rows = rows.assign(heading_deg=np.rad2deg(heading) % 360.0)
    empty = (
        "value_plain",
        "sigma_plain",
        "between_strips",
        "drift",
        "sigma_drift",
        "freedom",
        "sigma_adjusted",
    )
    rows = rows.assign(**dict.fromkeys(empty, np.nan))
    return rows.assign(mounting=pd.array([pd.NA] * 9, dtype="Int32"), outlying=_untested())


def _untested() -> Any:
    return pd.array([pd.NA] * 9, dtype="boolean")


def _in_units(mean: Floats) -> Floats:
    """Roll, pitch, yaw in degrees, offsets in metres."""
    return np.concatenate([np.rad2deg(misalignment_angles(mean[:3])), mean[3:]])


def camera_figures(item: CameraDifferences, result: TwoStep) -> TwoStepFigure:
    """Figures of one camera for summary.json."""
    main, everything = result.main, result.groups[0]
    of_mountings = [_mounting_figures(item, result, group) for group in (main, *result.others)]
    figures = {
        "camera": item.camera,
        "images": everything.images,
        "strips": everything.strips,
        "directions": result.directions,
        "images_of_main_mounting": main.images,
        "mountings_tested": result.mountings.tested,
        "mountings": of_mountings,
        "other_mountings": of_mountings[1:],
        "flights": [
            {
                "flight": item.flight_names[group.number],
                "mounting": group.mounting,
                "images": group.images,
                **_means(group),
            }
            for group in result.groups
            if group.scope == "flight"
        ],
        "offset_fixed_in": result.offset.verdict,
        "offset_sentence": offset_sentence(item.camera, result),
        "offset_rms_body_m": result.rms_body,
        "offset_rms_map_m": result.rms_map,
        "separated": _separated(item, result.offset),
        "tests": _tests(result.offset),
        **_means(main),
        "adjusted_minus_observed_in_camera_axes": {
            "all_plain": _in_camera_axes(item, everything.mean.plain),
            "all_robust": _in_camera_axes(item, everything.mean.robust),
            "main_robust": _in_camera_axes(item, main.mean.robust),
        },
    }
    return TwoStepFigure.model_validate(figures)


def _means(group: GroupMean) -> dict[str, JSON]:
    """Boresight, lever arm and shift of a group, with σ and degrees of freedom of the nine components."""
    value, sigma = _in_units(group.mean.robust), group.sigma * _SHOWN
    return {
        "boresight_deg": value[:3].tolist(),
        "boresight_sigma_deg": sigma[:3].tolist(),
        "lever_arm_m": value[3:6].tolist(),
        "lever_arm_sigma_m": sigma[3:6].tolist(),
        "shift_m": value[6:].tolist(),
        "shift_sigma_m": sigma[6:].tolist(),
        "freedom": group.freedom.tolist(),
    }


def _mounting_figures(item: CameraDifferences, result: TwoStep, group: GroupMean) -> dict[str, JSON]:
    """A mounting: its strips and its means."""
    return {
        "mounting": group.number,
        "strips": list(strip_names(item, result, group.number)),
        "images": group.images,
        **_means(group),
        "adjusted_minus_observed_in_camera_axes": _in_camera_axes(item, group.mean.robust),
    }


def _separated(item: CameraDifferences, offset: OffsetSeparation) -> JSON:
    """Lever arm (the whole one) and shift in plan, estimated together."""
    return {
        "lever_arm_m": (item.given_lever_arm[:2] + offset.lever_arm).tolist(),
        "lever_arm_sigma_m": offset.lever_arm_sigma.tolist(),
        "shift_m": offset.shift.tolist(),
        "shift_sigma_m": offset.shift_sigma.tolist(),
        "freedom": offset.freedom,
    }


def _tests(offset: OffsetSeparation) -> JSON:
    names = ("chi_squared", "freedom", "variance_freedom", "probability")
    return [{"tested": name, **attributes(test, *names)} for name, test in offset.tests.items()]


def _in_camera_axes(item: CameraDifferences, mean: Floats) -> JSON:
    """Adjusted − observed along x (columns), y (against rows), z of the camera: Tᵀ θ and −Tᵀ l."""
    camera_from_body = item.body_from_camera.T
    rotation_deg = np.rad2deg(camera_from_body @ mean[:3])
    return {"rotation_deg": rotation_deg.tolist(), "offset_m": (-camera_from_body @ mean[3:6]).tolist()}


def strip_names(item: CameraDifferences, result: TwoStep, mounting: int) -> tuple[str, ...]:
    """Names of the strips of a mounting."""
    return tuple(
        item.strip_names[strip] for strip in result.strips.strip[result.mountings.mounting == mounting]
    )


def columns_of(table: pd.DataFrame) -> Mapping[str, Any]:
    """Columns as the table writer takes them; what does not exist is null."""
    nullable = ("mounting", "outlying")
    names = [str(name) for name in table.columns]
    return {name: pd.array(table[name]) if name in nullable else table[name].to_numpy() for name in names}
