"""The request of a plan: which parameters to calibrate, with which prior knowledge and limits.

On the command line, parameters are named as in the project file.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from adjust.camera.additional.register import REGISTER
from adjust.camera.additional.selection import NOTHING, selected
from adjust.errors import AdditionalParametersError
from adjust.planning.a_priori import CalibrationModel, PlannedAdditional
from adjust.planning.network import PlannedNetwork
from tasks.block.block_input import refuse_heads
from tasks.block.observation_types import prior_sigmas
from tasks.block.self_calibration import CalibratedImages, additional_parameters_of, self_calibration_of
from tasks.errors import InputError
from tasks.nearest_name import did_you_mean
from tasks.quantities import KINDS
from tasks.settings.adjustment import AdjustmentSettings, FreeParameter, Priors, SelfCalibrationSettings
from tasks.settings.calibration import AcceptanceLimits, CalibrationSettings

_STRIP_BIAS: FreeParameter = "gnss_strip_bias"
#: So little is known beforehand that σ/σ_prior tells what the flight adds.
WEAK_PRIORS = Priors(
    focal_length_mm=1.0,
    principal_point_mm=(1.0, 1.0),
    boresight_deg=(5.7, 5.7, 5.7),
    lever_arm_m=(1.0, 1.0, 1.0),
    gnss_shift_m=(10.0, 10.0, 10.0),
    gnss_drift_m_s=(1.0, 1.0, 1.0),
    ins_strip_bias_deg=(5.7, 5.7, 5.7),
    ins_drift_deg_s=(1.0, 1.0, 1.0),
    time_offset_s=1.0,
    relative_position_m=(1.0, 1.0, 1.0),
    relative_rotation_deg=(5.7, 5.7, 5.7),
    synchronisation_offset_s=1.0,
)
#: The same for additional parameters: their largest effect in the image, µm.
WEAK_EFFECT_UM = 1000.0


@dataclass(frozen=True)
class PlanRequest:
    """What is to be calibrated.

    Attributes
    ----------
    free : system parameters to estimate, besides the biases of the strips.
    strip_bias_m : σ of a GNSS error common to a strip, m; 0: the errors are independent.
    priors : what is known beforehand; what is not given there is hardly known (`WEAK_PRIORS`).
    limits : of an accepted flight.
    gnss_correlation_s, ins_correlation_s : correlation times of the errors within a strip, s.
    self_calibration : additional parameters to estimate; all of them, as before those that are not
        significant are eliminated.
    """

    free: tuple[FreeParameter, ...]
    strip_bias_m: float = 0.03
    priors: Priors = field(default_factory=Priors)
    limits: AcceptanceLimits = field(default_factory=AcceptanceLimits)
    gnss_correlation_s: float | None = None
    ins_correlation_s: float | None = None
    self_calibration: SelfCalibrationSettings = field(default_factory=SelfCalibrationSettings)

    @classmethod
    def of(
        cls,
        calibration: CalibrationSettings,
        adjustment: AdjustmentSettings,
        free: tuple[FreeParameter, ...] | None = None,
        additional: str | None = None,
        strip_bias_m: float | None = None,
    ) -> PlanRequest:
        """What `aerocal calibrate` would estimate with these settings, unless told otherwise."""
        chosen, own = free or calibration.free, adjustment.self_calibration
        if strip_bias_m is None:
            stated = max(adjustment.priors.gnss_strip_bias_m)
            strip_bias_m = stated if _STRIP_BIAS in (*chosen, *calibration.free) else 0.0
        return cls(
            tuple(name for name in chosen if name != _STRIP_BIAS),
            strip_bias_m,
            adjustment.priors,
            calibration.limits,
            adjustment.gnss_correlation_s,
            adjustment.ins_correlation_s,
            own if additional is None else own.model_copy(update={"parameters": additional}),
        )

    @property
    def estimated(self) -> tuple[FreeParameter, ...]:
        """All that is free, biases of the strips included."""
        return (*self.free, _STRIP_BIAS) if self.strip_bias_m > 0.0 else self.free

    @property
    def has_additional(self) -> bool:
        """Whether there are additional parameters to estimate."""
        return self.self_calibration.parameters != NOTHING

    def model(self, network: PlannedNetwork) -> CalibrationModel:
        """The same in terms of the adjustment of a network.

        Raises
        ------
        InputError
            If a camera cannot have the additional parameters, or mountings of heads are free without a rig.
        """
        if network.rig is None:
            refuse_heads(KINDS[name] for name in self.estimated)
        free: dict[str, tuple[int, ...]] = {}
        for name in self.estimated:
            kind = KINDS[name]
            free[kind.family] = tuple(sorted((*free.get(kind.family, ()), *kind.components)))
        given = {key: value for key, value in self.priors.model_dump().items() if value is not None}
        bias = max(self.strip_bias_m, np.finfo(float).tiny)
        known = WEAK_PRIORS.model_copy(update={**given, "gnss_strip_bias_m": (bias, bias, bias)})
        return CalibrationModel(
            free,
            prior_sigmas(known),
            self.gnss_correlation_s,
            self.ins_correlation_s,
            self._additional(network),
        )

    def _additional(self, network: PlannedNetwork) -> PlannedAdditional | None:
        settings = self.self_calibration
        if not self.has_additional:
            return None
        cameras = tuple(camera.name for camera in network.cameras)
        of_camera = [
            additional_parameters_of(name, settings.parameters, image_format, turn)
            for name, image_format, turn in zip(
                cameras, network.formats, network.calibration_axes_deg, strict=True
            )
        ]
        flight = network.exposures.flight[network.event_of_image]
        images = CalibratedImages(cameras, network.camera_of_image, network.flights, flight)
        found = self_calibration_of(images, of_camera, [{}] * len(cameras), settings)
        return PlannedAdditional(
            found.model, found.parameters, found.prior(settings.sigma_um or WEAK_EFFECT_UM)
        )


def free_from_text(text: str) -> tuple[FreeParameter, ...]:
    """Names separated by commas, as in `adjustment.free`.

    Raises
    ------
    InputError
        If one of them does not exist, or there is none.
    """
    names = list(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    for name in names:
        if name not in KINDS:
            raise InputError(
                f"'{name}' is not a parameter that can be calibrated.", did_you_mean(name, KINDS)
            )
    if not names:
        raise InputError("--free names no parameter.", f"Name at least one of: {', '.join(KINDS)}.")
    return tuple(names)


def selection_from_text(text: str) -> str:
    """A selection of additional parameters, as in `adjustment.self_calibration.parameters`.

    Raises
    ------
    InputError
        If the register does not know it.
    """
    try:
        selected(text, REGISTER)
    except AdditionalParametersError as error:
        raise InputError(
            f"The additional parameters '{text}' are not known: {error}",
            'Write for example "bluh:1-12"; docs/additional-parameters.md lists all sets.',
            entity="--additional",
        ) from error
    return text.strip()
