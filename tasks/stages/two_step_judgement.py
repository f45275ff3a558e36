"""Whether a two-step calibration by itself, without image points, gives boresight and offset well enough.

It does not determine the interior orientation, whose errors the adjusted orientations have absorbed. So
there is no record and no certificate, only a verdict on the means of the strips, by the same limits.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from adjust.calibration.mean_variance import widening
from tasks.calibration.verdicts import REFUSED, RESTRICTED
from tasks.quantities import kind_of, named
from tasks.results.calibration_figures import TwoStepFigure, TwoStepParameterFigure, TwoStepVerdictFigure
from tasks.results.figure import Values
from tasks.results.figures import figures_of
from tasks.settings.calibration import AcceptanceLimits
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, read_notes, write_notes
from tasks.store.store import stored

#: Figure of a two-step calibration by itself in summary.json.
TWO_STEP_ONLY = "two_step_calibration"
#: What it does not give.
ONLY = (
    "Two-step calibration only, from delivered orientations: no image points, so focal length and principal "
    "point are not calibrated, and there is no record and no certificate of the interior orientation."
)
_ANGLES = ("roll", "pitch", "yaw")
# Mean of one strip: its error cannot be separated from a boresight.
_LEAST_STRIPS = 2


@stored("judgement")
def judge_two_steps(folder: Path, *, two_step: Artifact, limits: AcceptanceLimits) -> None:
    """Write notes with the verdict.

    Parameters
    ----------
    two_step : notes of `tasks.stages.two_step.calibrate_in_two_steps`.
    """
    cameras = figures_of(read_notes(two_step).figures).two_step
    parameters = [item for camera in cameras for item in _parameters(camera, limits)]
    reasons = [
        f"{named(item.parameter, item.camera)} is {item.verdict.replace('_', ' ')}: {item.because}."
        for item in parameters
        if item.verdict in ("weak", "not_determinable") and kind_of(item.parameter) == "boresight"
    ]
    restrictions = [sentence for camera in cameras for sentence in _restrictions(camera)]
    verdict = "refused" if reasons else "restricted" if restrictions else "accepted"
    figures = TwoStepVerdictFigure(
        verdict=verdict,
        sentence=ONLY,
        reasons=tuple(reasons),
        restrictions=tuple(restrictions),
        parameters=tuple(parameters),
    )
    against = (
        *(f"{REFUSED}{reason}" for reason in reasons),
        *(f"{RESTRICTED}{sentence}" for sentence in restrictions),
    )
    write_notes(folder, Notes((*against, ONLY), {TWO_STEP_ONLY: figures.to_json()}, reasons=against))


def _parameters(camera: TwoStepFigure, limits: AcceptanceLimits) -> Iterator[TwoStepParameterFigure]:
    main = camera.mountings[0]
    strips = len(main.strips)
    of_angles = (limits.roll_pitch_deg, limits.roll_pitch_deg, limits.yaw_deg)
    for number, name in enumerate(_ANGLES):
        value, sigma = main.boresight_deg[number], main.boresight_sigma_deg[number]
        found = _Estimate(value, sigma, main.freedom[number])
        yield _judged(f"boresight_{name}", camera, "deg", found, of_angles[number], limits, strips)
    called = _called_for(camera)
    fixed_in = camera.offset_fixed_in
    for family, limit in (("lever_arm", limits.lever_arm_m), ("gnss_shift", limits.shift_m)):
        for number, axis in enumerate("xy"):
            name = f"{family}_{axis}"
            if (known := called[family]) is not None:
                yield _judged(name, camera, "m", known[number], limit, limits, strips)
                continue
            undecided = fixed_in == "undecided"
            why = "the headings do not separate lever arm and shift" if undecided else "by the nested tests"
            yield TwoStepParameterFigure(
                parameter=name,
                camera=camera.camera,
                unit="m",
                limit=limit,
                verdict="not_determinable" if undecided else "not_called_for",
                because=why,
            )


@dataclass(frozen=True)
class _Estimate:
    """A value with σ and degrees of freedom."""

    value: float | None
    sigma: float | None
    freedom: float | None

    @property
    def widened(self) -> float | None:
        """σ by which 95 % of the normal distribution hold; None: no strips show it."""
        if self.sigma is None or self.freedom is None or not np.isfinite(self.sigma):
            return None
        return float(self.sigma * widening(self.freedom))


def _called_for(camera: TwoStepFigure) -> dict[str, tuple[_Estimate, _Estimate] | None]:
    """Estimates in plan that the tests require; both together if they require both."""
    main, both = camera.mountings[0], camera.separated
    fixed_in = camera.offset_fixed_in

    own = both if fixed_in == "both" else main

    def of(values: Values, sigmas: Values, place: int) -> tuple[_Estimate, _Estimate]:
        freedom = (both.freedom,) * 2 if fixed_in == "both" else main.freedom[place : place + 2]
        first, second = (_Estimate(values[k], sigmas[k], freedom[k]) for k in range(2))
        return first, second

    return {
        "lever_arm": of(own.lever_arm_m, own.lever_arm_sigma_m, 3) if fixed_in in ("body", "both") else None,
        "gnss_shift": of(own.shift_m, own.shift_sigma_m, 6) if fixed_in in ("map", "both") else None,
    }


def _judged(
    name: str,
    camera: TwoStepFigure,
    unit: str,
    found: _Estimate,
    limit: float,
    limits: AcceptanceLimits,
    strips: int,
) -> TwoStepParameterFigure:
    """By its σ against the limit, as in the one-step calibration; that of few strips is widened."""
    judged = partial(
        TwoStepParameterFigure,
        parameter=name,
        camera=camera.camera,
        unit=unit,
        value=found.value,
        limit=limit,
    )
    widened = found.widened
    if widened is None or strips < _LEAST_STRIPS:
        why = f"{strips} strip does not show how strips scatter: fly more of them"
        return judged(verdict="not_determinable", because=why)
    if widened <= limit:
        return judged(sigma=found.sigma, verdict="determined")
    verdict = "weak" if widened <= limits.weak_up_to * limit else "not_determinable"
    why = (
        f"σ {found.sigma:.2g} {unit}, with {found.freedom:.0f} degrees of freedom as good as {widened:.2g} "
        f"{unit}, limit {limit:g} {unit}, with {strips} strips: fly more of them"
    )
    return judged(sigma=found.sigma, verdict=verdict, because=why)


def _restrictions(camera: TwoStepFigure) -> Iterator[str]:
    name, mountings = camera.camera, camera.mountings
    if len(mountings) > 1:
        others = sum(item.images for item in mountings[1:])
        yield (
            f"Camera {name} was not flown with one mounting but with {len(mountings)}: the values are those "
            f"of {mountings[0].images:,} images; the {others:,} others have means of their own."
        )
    if camera.offset_fixed_in == "undecided":
        yield (
            f"The offset of camera {name} is neither a lever arm nor a shift by these strips: it holds for "
            "flights in the same direction only."
        )
