"""Tables, figures and remarks of a two-step calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from adjust.calibration.indicated_lever_arm import UNSTATED_SHIFT
from adjust.calibration.orientation_differences import COMPONENTS, misalignment_angles
from adjust.calibration.two_step import GroupMean, TwoStep
from tasks.block.orientation_pairs import CameraDifferences
from tasks.plausibility.lever_arm import lever_arm_suspicion
from tasks.storage.json_text import JSON

# Radians are shown in degrees.
_SHOWN = np.array([np.rad2deg(1.0)] * 3 + [1.0] * 6)
_UNITS = ("deg",) * 3 + ("m",) * 6
# A drift is mentioned if it is larger than this and this many times its standard deviation.
_NOTABLE_DRIFT_DEG = 0.01
_NOTABLE_T = 5.0


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
        "mounting": result.outlying.mounting[strip],
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
        "heading": f"{np.rad2deg(group.heading) % 360.0:.0f} deg",
        "height": f"{group.height:.0f} m",
    }[group.scope]
    rows = _rows(group.scope, name, group.images, group.strips, group.heading, group.height)
    return rows.assign(
        value_plain=_in_units(mean.plain),
        sigma_plain=mean.plain_sigma * _SHOWN,
        value=_in_units(mean.robust),
        sigma=mean.robust_sigma * _SHOWN,
        rms=mean.rms * _SHOWN,
        between_strips=group.between * _SHOWN,
    )


def _strip_rows(item: CameraDifferences, result: TwoStep) -> pd.DataFrame:
    strips, tables = result.strips, []
    # The offset is tested in one of the two axes only.
    tested = np.hstack([result.outlying.outlying, np.zeros((len(strips.strip), 3), dtype=bool)])
    if result.tested_axes == "map":
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
                mounting=pd.array([result.outlying.mounting[k]] * 9, dtype="Int32"),
                outlying=pd.array(tested[k], dtype="boolean") if result.outlying.tested else _untested(),
            )
        )
    return pd.concat(tables)


def _rows(scope: str, name: str, images: int, strips: int, heading: float, height: float) -> pd.DataFrame:
    rows = pd.DataFrame({"component": COMPONENTS, "unit": _UNITS})
    rows = rows.assign(scope=scope, group=name, images=images, strips=strips, height_m=height)
    rows = rows.assign(heading_deg=np.rad2deg(heading) % 360.0)
    empty = ("value_plain", "sigma_plain", "between_strips", "drift", "sigma_drift")
    rows = rows.assign(**dict.fromkeys(empty, np.nan))
    return rows.assign(mounting=pd.array([pd.NA] * 9, dtype="Int32"), outlying=_untested())


def _untested() -> Any:
    return pd.array([pd.NA] * 9, dtype="boolean")


def _in_units(mean: Floats) -> Floats:
    """Roll, pitch, yaw in degrees, offsets in metres."""
    return np.concatenate([np.rad2deg(misalignment_angles(mean[:3])), mean[3:]])


def camera_figures(item: CameraDifferences, result: TwoStep) -> dict[str, JSON]:
    """Figures of one camera for summary.json."""
    main, everything, axes = result.main, result.groups[0], result.axes
    return {
        "camera": item.camera,
        "images": everything.images,
        "strips": everything.strips,
        "images_of_main_mounting": main.images,
        "other_mountings": _others(item, result),
        "offset_fixed_in": axes.axes,
        "offset_rms_body_m": axes.rms_body,
        "offset_rms_map_m": axes.rms_map,
        "boresight_deg": _in_units(main.mean.robust)[:3].tolist(),
        "boresight_sigma_deg": (main.mean.robust_sigma * _SHOWN)[:3].tolist(),
        "lever_arm_m": main.mean.robust[3:6].tolist(),
        "lever_arm_sigma_m": main.mean.robust_sigma[3:6].tolist(),
        "shift_m": main.mean.robust[6:].tolist(),
        "shift_sigma_m": main.mean.robust_sigma[6:].tolist(),
        "adjusted_minus_observed_in_camera_axes": {
            "all_plain": _in_camera_axes(item, everything.mean.plain),
            "all_robust": _in_camera_axes(item, everything.mean.robust),
            "main_robust": _in_camera_axes(item, main.mean.robust),
        },
    }


def _in_camera_axes(item: CameraDifferences, mean: Floats) -> JSON:
    """Adjusted − observed along x (columns), y (against rows), z of the camera: Tᵀ θ and −Tᵀ l."""
    camera_from_body = item.body_from_camera.T
    rotation_deg = np.rad2deg(camera_from_body @ mean[:3])
    return {"rotation_deg": rotation_deg.tolist(), "offset_m": (-camera_from_body @ mean[3:6]).tolist()}


def _others(item: CameraDifferences, result: TwoStep) -> list[JSON]:
    found: list[JSON] = []
    for group in result.groups:
        if group.scope == "mounting" and group.number > 0:
            strips = _names(item, result, result.outlying.mounting == group.number)
            found.append(
                {
                    "strips": list(strips),
                    "images": group.images,
                    "boresight_deg": _in_units(group.mean.robust)[:3].tolist(),
                    "lever_arm_m": group.mean.robust[3:6].tolist(),
                    "adjusted_minus_observed_in_camera_axes": _in_camera_axes(item, group.mean.robust),
                }
            )
    return found


def _names(item: CameraDifferences, result: TwoStep, chosen: Any) -> tuple[str, ...]:
    return tuple(item.strip_names[strip] for strip in result.strips.strip[chosen])


def camera_remarks(item: CameraDifferences, result: TwoStep, error_probability: float) -> tuple[str, ...]:
    """What contradicts one boresight and one offset for all, in words."""
    found = result.main.mean
    sigma = np.nan_to_num(found.robust_sigma[3:6])
    # In height a shift looks like a lever arm in every strip.
    sigma[2] = np.hypot(sigma[2], UNSTATED_SHIFT)
    slip = lever_arm_suspicion(item.given_lever_arm, found.robust[3:6], sigma, item.camera)
    # Only an offset that is fixed in the aircraft says something about the lever arm.
    remarks = [slip] if slip is not None and result.axes.axes == "body" else []
    for group in result.groups:
        if group.scope == "mounting" and group.number > 0:
            names = ", ".join(_names(item, result, result.outlying.mounting == group.number))
            remarks.append(
                f"Strips {names} ({group.images:,} images) have another mounting of camera {item.camera}: "
                f"lever arm {_plan(group)} m forward, right, against {_plan(result.main)} m. They are left "
                "out of the result (probability of calling any strip outlying by chance "
                f"{100 * error_probability:g} %): give them a camera of their own."
            )
    if not result.outlying.tested:
        remarks.append(
            f"Camera {item.camera}: {len(result.strips.strip)} strips are too few to tell one of another "
            "mounting from their scatter."
        )
    if result.axes.axes == "map":
        remarks.append(
            f"The offset of camera {item.camera} is fixed in the map, not in the aircraft (RMS in plan "
            f"{result.axes.rms_map:.3f} m against {result.axes.rms_body:.3f} m): a GNSS shift or a datum, "
            "not a lever arm."
        )
    elif result.axes.axes == "undecided":
        remarks.append(
            f"Camera {item.camera}: lever arm and GNSS shift cannot be told apart with "
            f"{result.axes.directions} direction(s) of flight and these strips."
        )
    return (*remarks, *_drifts(item, result))


def _plan(group: GroupMean) -> str:
    forward, right = group.mean.robust[3:5]
    return f"({forward:+.2f}, {right:+.2f})"


def _drifts(item: CameraDifferences, result: TwoStep) -> Sequence[str]:
    strips = result.strips
    drift, sigma = np.rad2deg(strips.drift[:, :3]), np.rad2deg(strips.drift_sigma[:, :3])
    notable = (np.abs(drift) > _NOTABLE_DRIFT_DEG) & (np.abs(drift) > _NOTABLE_T * sigma)
    return [
        f"Strip {item.strip_names[strips.strip[k]]}: the {COMPONENTS[j]} of the INS drifts by "
        f"{drift[k, j]:+.4f}° ± {sigma[k, j]:.4f}° against the adjusted orientations."
        for k, j in np.argwhere(notable)
    ]


def columns_of(table: pd.DataFrame) -> Mapping[str, Any]:
    """Columns as the table writer takes them; what does not exist is null."""
    nullable = ("mounting", "outlying")
    names = [str(name) for name in table.columns]
    return {name: pd.array(table[name]) if name in nullable else table[name].to_numpy() for name in names}
