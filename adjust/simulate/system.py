"""The camera system as it truly is: interior orientation, mounting, and what GNSS gets wrong.

Everything here is what a calibration looks for; random strip biases and drifts are drawn from streams of
their own, so they belong to the truth and not to the noise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from adjust.arrays import Floats
from adjust.camera.interior import FrameCamera
from adjust.errors import InconsistentBlockError
from adjust.parameters import (
    BORESIGHT,
    GNSS_DRIFT,
    GNSS_SHIFT,
    GNSS_STRIP_BIAS,
    INS_DRIFT,
    INS_STRIP_BIAS,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    TIME_OFFSET,
)
from adjust.simulate.flight_plan import FlightPlan
from adjust.simulate.random_streams import RandomStreams, Source

Triple = tuple[float, float, float]
_ZERO: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SystemSpecification:
    """True values of the camera system; metres, radians, seconds.

    Attributes
    ----------
    interior_change : true minus certified focal length, principal point x, y.
    boresight : roll, pitch, yaw.
    lever_arm : from the projection centre to the antenna, body axes.
    gnss_shift : of every flight, local axes.
    gnss_shift_of_flight : of single flights, instead.
    strip_bias : standard deviations of the random shifts of the strips.
    strip_drift : standard deviations of the drifts of the strips, m/s.
    ins_strip_bias, ins_drift : the same of the attitudes, roll, pitch, yaw, radians and rad/s.
    time_offset : that the positions are taken after the exposures.
    refraction : whether rays are refracted.
    """

    interior_change: Triple = _ZERO
    boresight: Triple = _ZERO
    lever_arm: Triple = _ZERO
    gnss_shift: Triple = _ZERO
    gnss_shift_of_flight: Mapping[str, Triple] = field(default_factory=dict)
    strip_bias: Triple = _ZERO
    strip_drift: Triple = _ZERO
    ins_strip_bias: Triple = _ZERO
    ins_drift: Triple = _ZERO
    time_offset: float = 0.0
    refraction: bool = False

    @property
    def of_strips(self) -> Mapping[str, Triple]:
        """Standard deviations of what is random in every strip, by family."""
        return {
            GNSS_STRIP_BIAS: self.strip_bias,
            GNSS_DRIFT: self.strip_drift,
            INS_STRIP_BIAS: self.ins_strip_bias,
            INS_DRIFT: self.ins_drift,
        }


def true_system(
    specification: SystemSpecification,
    cameras: tuple[FrameCamera, ...],
    plan: FlightPlan,
    streams: RandomStreams,
) -> Mapping[str, Floats]:
    """True values of all families of system parameters: name → (entities, components).

    Raises
    ------
    InconsistentBlockError : if a shift is given for a flight that the plan does not have.
    """
    unknown = sorted(set(specification.gnss_shift_of_flight) - set(plan.flights))
    if unknown:
        raise InconsistentBlockError(
            f"A GNSS shift is given for flight {unknown[0]}; the flights are {', '.join(plan.flights)}."
        )
    shifts = [
        specification.gnss_shift_of_flight.get(flight, specification.gnss_shift) for flight in plan.flights
    ]
    return {
        INTERIOR_ORIENTATION: certified_interior(cameras) + specification.interior_change,
        BORESIGHT: np.tile(np.array(specification.boresight), (len(cameras), 1)),
        LEVER_ARM: np.tile(np.array(specification.lever_arm), (len(cameras), 1)),
        GNSS_SHIFT: np.array(shifts, dtype=np.float64),
        **strip_errors(specification, len(plan.strips), streams),
        TIME_OFFSET: np.full((len(plan.flights), 1), specification.time_offset),
    }


def strip_errors(
    specification: SystemSpecification, strips: int, streams: RandomStreams
) -> Mapping[str, Floats]:
    """The random biases and drifts of the strips: name of the family → (strips, 3)."""
    sources = {
        GNSS_STRIP_BIAS: Source.STRIP_BIAS,
        GNSS_DRIFT: Source.STRIP_DRIFT,
        INS_STRIP_BIAS: Source.INS_STRIP_BIAS,
        INS_DRIFT: Source.INS_STRIP_DRIFT,
    }
    return {
        family: streams.of(sources[family]).standard_normal((strips, 3)) * sigma
        for family, sigma in specification.of_strips.items()
    }


def certified_interior(cameras: tuple[FrameCamera, ...]) -> Floats:
    """Focal length and principal point (c, 3) as the cameras' certificates have them, metres."""
    return np.array([[camera.focal_length, *camera.principal_point] for camera in cameras])
