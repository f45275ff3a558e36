"""What the tables of residuals and orientations of a report must say, from the published files alone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

Item = tuple[tuple[str, str, str], float | None]
DIRECT = {"gnss": ("gnss_positions", "xyz", 1.0), "ins": ("ins_attitudes", ("roll", "pitch", "yaw"), 1e3)}
KEY = ["group", "image", "point", "component"]


def observation_group_of(residuals: pd.DataFrame) -> pd.Series:
    """The group of each row, without the strip of a prior or the other end of a distance."""
    return residuals["group"].str.replace(r"^(prior:[^:]*|[^:]*)(:.*)?$", r"\1", regex=True)


def worst(residuals: pd.DataFrame) -> Iterator[Item]:
    """The eight largest of each group."""
    used = residuals[(residuals["status"] == "used") & residuals["standardized"].notna()]
    for _, own in used.groupby(observation_group_of(used)):
        largest = own.reindex(own["standardized"].abs().sort_values(ascending=False, kind="stable").index)
        for row in largest.head(8).to_dict("records"):
            key = "|".join("" if pd.isna(row[name]) else str(row[name]) for name in KEY)
            for column in ("residual", "sigma", "standardized"):
                yield ("worst-residuals", key, column), row[column]


def by_image(residuals: pd.DataFrame, images: pd.DataFrame) -> pd.DataFrame:
    """One row for each image, counted row by row."""
    rows = []
    for image, strip in zip(images["image"], images["strip"], strict=True):
        own = residuals[residuals["image"] == image]
        rays: dict[str, dict[str, Any]] = {}
        for row in own[own["group"] == "image_points"].itertuples():
            rays.setdefault(str(row.point), {})[str(row.component)] = row
        points: dict[str, list[float]] = {"x": [], "y": []}
        w, rejected = [0.0], 0
        for both in rays.values():
            status = {one.status for one in both.values()}
            if status <= {"used", "uncontrolled"}:
                points["x"].append(both["x"].residual)
                points["y"].append(both["y"].residual)
                w += [abs(one.standardized) for one in both.values() if not np.isnan(one.standardized)]
            else:
                rejected += "rejected" in status
        counted: dict[str, object] = {
            "image": image,
            "strip": strip,
            "points": float(len(points["x"])),
            "rejected": float(rejected),
            **{f"rms_{axis}_um": float(np.sqrt(np.mean(np.square(points[axis])))) for axis in "xy"},
            "largest_w": max(w),
        }
        for name, (group, components, factor) in DIRECT.items():
            of_group = own[own["group"] == group].set_index("component")["residual"]
            counted |= {f"{name}_{axis}": of_group.get(axis, np.nan) * factor for axis in components}
        rows.append(counted)
    return pd.DataFrame(rows)


def lists(residuals: pd.DataFrame, images: pd.DataFrame) -> Iterator[Item]:
    """The lists by image and by strip."""
    table = by_image(residuals, images)
    direct = [f"{name}_{axis}" for name, (_, components, _) in DIRECT.items() for axis in components]
    for row in table.to_dict("records"):
        for column in ("points", "rejected", "rms_x_um", "rms_y_um", "largest_w", *direct):
            yield ("image-list", row["image"], column), row[column]
    for strip, own in table.groupby("strip"):
        yield ("strip-list", str(strip), "images"), float(len(own))
        for column in ("points", "rejected"):
            yield ("strip-list", str(strip), column), own[column].sum()
        for axis in "xy":
            squares = (own[f"rms_{axis}_um"] ** 2 * own["points"]).sum() / own["points"].sum()
            yield ("strip-list", str(strip), f"rms_{axis}_um"), float(np.sqrt(squares))
        yield ("strip-list", str(strip), "largest_w"), own["largest_w"].max()
        if not own[direct].notna().any(axis=None):
            continue
        yield ("strip-direct-list", str(strip), "images"), float(own[direct].notna().sum().max())
        for column in direct:
            yield ("strip-direct-list", str(strip), f"mean_{column}"), own[column].mean()
            rms = float(np.sqrt((own[column] ** 2).mean()))
            yield ("strip-direct-list", str(strip), f"rms_{column}"), rms


def orientations(table: pd.DataFrame) -> Iterator[Item]:
    """The list of orientations; σ of angles in millidegrees."""
    for row in table.to_dict("records"):
        for column, value in row.items():
            if str(column).endswith(("_m", "_deg")):
                factor = 1e3 if str(column).startswith("sigma") and str(column).endswith("deg") else 1.0
                yield ("orientation-list", row["image"], str(column)), value * factor


def neighbours(table: pd.DataFrame) -> Iterator[Item]:
    """Correlation of neighbouring images; σ of differences of angles in millidegrees."""
    for axis in (*"xyz", "omega", "phi", "kappa") if len(table) else ():
        rho = table[f"rho_{axis}"]
        unit, factor = ("m", 1.0) if axis in "xyz" else ("deg", 1e3)
        sigma = table[f"sigma_d{axis}_{unit}"] * factor
        for column, value in (("min", rho.min()), ("median", rho.median()), ("max", rho.max())):
            yield ("neighbours", axis, column), value
        yield ("neighbours", axis, "sigma"), sigma.median()
        yield ("neighbours", axis, "largest"), sigma.max()
