"""Differences at independent check points, and every quantity that a statement may limit or quote."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from adjust.arrays import Bools, Floats

if TYPE_CHECKING:
    import pandas as pd

#: The points that a part of a statement is about: with a position, with a height, with both; and with a
#: height under vegetation. Those under vegetation belong to no other.
Points: TypeAlias = Literal["plan", "height", "both", "vegetated"]


@dataclass(frozen=True, eq=False)
class CheckPointDifferences:
    """Differences at the n independent check points.

    Attributes
    ----------
    difference : (n, 3) computed − given along east, north, up, metres; NaN where not known.
    survey_sigma : (n, 3) standard deviations of the given coordinates, metres.
    vegetated : (n,) points under vegetation; None: none.
    control : how many points were control, and so are no check points.
    """

    difference: Floats
    survey_sigma: Floats
    vegetated: Bools | None = None
    control: int = 0

    @property
    def has_plan(self) -> Bools:
        """(n,) points with both plan coordinates."""
        return np.asarray(np.isfinite(self.difference[:, :2]).all(axis=1))

    @property
    def has_height(self) -> Bools:
        """(n,) points with a height."""
        return np.asarray(np.isfinite(self.difference[:, 2]))

    @property
    def rmse(self) -> tuple[float, float, float]:
        """RMSE of x, y, z, metres; not centred."""
        plan, height = self.difference[self.has_plan, :2], self.difference[self.has_height, 2]
        return _rms(plan[:, 0]), _rms(plan[:, 1]), _rms(height)

    @property
    def survey_rmse(self) -> tuple[float, float]:
        """RMSE of the survey, radial and in height, metres."""
        plan, height = self.survey_sigma[self.has_plan, :2], self.survey_sigma[self.has_height, 2]
        return _rms(np.hypot(plan[:, 0], plan[:, 1])), _rms(height)

    def of(self, points: Points) -> CheckPointDifferences:
        """The differences that a part of a statement covers."""
        under = np.zeros(len(self.difference), dtype=bool) if self.vegetated is None else self.vegetated
        chosen = {
            "plan": self.has_plan,
            "height": self.has_height & ~under,
            "both": self.has_plan & self.has_height & ~under,
            "vegetated": self.has_height & under,
        }[points]
        return replace(
            self, difference=self.difference[chosen], survey_sigma=self.survey_sigma[chosen], vegetated=None
        )


def check_point_differences(
    check_points: pd.DataFrame,
    control_points: pd.DataFrame,
    vegetated: Collection[str] = (),
    control: int = 0,
) -> CheckPointDifferences:
    """Differences from check_points and control_points (tables), and the names of points under vegetation."""
    surveyed = control_points.set_index("point").loc[check_points["point"]]
    return CheckPointDifferences(
        check_points[[f"d{axis}_m" for axis in "xyz"]].to_numpy(np.float64),
        surveyed[[f"sigma_{axis}_m" for axis in "xyz"]].to_numpy(np.float64),
        check_points["point"].isin(list(vegetated)).to_numpy(),
        control,
    )


def _rms(values: Floats) -> float:
    """Root mean square, not centred; NaN without values."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def _largest(values: Floats) -> float:
    known = np.abs(values[np.isfinite(values)])
    return float(known.max()) if len(known) else float("nan")


def _mean(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def _rmse_h(found: CheckPointDifferences) -> float:
    x, y, _ = found.rmse
    return float(np.hypot(np.hypot(x, y), found.survey_rmse[0]))


def _rmse_v(found: CheckPointDifferences) -> float:
    return float(np.hypot(found.rmse[2], found.survey_rmse[1]))


def _accuracy_r(found: CheckPointDifferences) -> float:
    """95 % circle; equals 1.7308 RMSE_r for equal RMSE. NaN below a ratio of the two of 0.6."""
    x, y, _ = found.rmse
    ratio = min(x, y) / max(x, y) if max(x, y) > 0.0 else 1.0
    return 2.4477 * 0.5 * (x + y) if ratio >= 0.6 else float("nan")


#: By name, in metres. RMSE_x to RMSE_r, mean and max are of the differences alone; RMSE_H, RMSE_V and RMSE_3D
#: contain the survey; Accuracy_r and Accuracy_z are the 95 % figures of the NSSDA. None is centred.
QUANTITIES: Mapping[str, Callable[[CheckPointDifferences], float]] = {
    "RMSE_x": lambda found: found.rmse[0],
    "RMSE_y": lambda found: found.rmse[1],
    "RMSE_z": lambda found: found.rmse[2],
    "RMSE_r": lambda found: float(np.hypot(found.rmse[0], found.rmse[1])),
    "RMSE_H": _rmse_h,
    "RMSE_V": _rmse_v,
    "RMSE_3D": lambda found: float(np.hypot(_rmse_h(found), _rmse_v(found))),
    "Accuracy_r": _accuracy_r,
    "Accuracy_z": lambda found: 1.9600 * found.rmse[2],
    "mean_x": lambda found: _mean(found.difference[:, 0]),
    "mean_y": lambda found: _mean(found.difference[:, 1]),
    "mean_z": lambda found: _mean(found.difference[:, 2]),
    "max_x": lambda found: _largest(found.difference[:, 0]),
    "max_y": lambda found: _largest(found.difference[:, 1]),
    "max_z": lambda found: _largest(found.difference[:, 2]),
    "max_r": lambda found: _largest(np.hypot(found.difference[:, 0], found.difference[:, 1])),
    "survey_H": lambda found: found.survey_rmse[0],
    "survey_V": lambda found: found.survey_rmse[1],
}
