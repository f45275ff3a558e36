"""Settings of a system calibration: when its result is good enough to be used."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from tasks.settings.adjustment import FreeParameter
from tasks.settings.base import Settings
from tasks.settings.coordinates import NotNegative, NotNegativeTriple, Positive, Real, Whole
from tasks.settings.inputs import ExposuresInput


class AcceptanceLimits(Settings):
    """What a calibration flight must reach, standard deviations computed with the stochastic model given."""

    focal_length_um: Positive = Field(default=2.0, description="σ of the focal length, µm.")
    principal_point_um: Positive = Field(default=1.0, description="σ of the principal point x, y, µm.")
    roll_pitch_deg: Positive = Field(default=0.0005, description="σ of boresight roll and pitch, degrees.")
    yaw_deg: Positive = Field(default=0.001, description="σ of boresight yaw, degrees.")
    shift_m: Positive = Field(default=0.03, description="σ of a GNSS shift x, y, z, m.")
    lever_arm_m: Positive = Field(default=0.03, description="σ of a lever arm x, y, z, m.")
    sigma_over_prior: Annotated[Real, Field(gt=0.0, le=1.0)] = Field(
        default=0.3,
        description="σ over the σ of the initial value; near 1 the flight has added nothing to what was "
        "known before, however small the correlations are.",
    )
    weak_up_to: Annotated[Real, Field(ge=1.0)] = Field(
        default=3.0,
        description="Multiple of a limit up to which a parameter is called weak; beyond it is not "
        "determinable.",
    )
    headings: Annotated[Whole, Field(ge=1)] = Field(
        default=2,
        description="Flight directions (opposite or crossing), where a principal point, a shift or a lever "
        "arm is calibrated.",
    )
    height_ratio: Annotated[Real, Field(ge=1.0)] = Field(
        default=2.0,
        description="Highest over lowest flying height above ground, where a focal length, or a principal "
        "point together with a lever arm, is calibrated; 1: one height may do, if the σ are reached.",
    )
    correlation: Annotated[Real, Field(gt=0.0, lt=1.0)] = Field(
        default=0.95,
        description="Correlation of two calibrated parameters that is remarked on. Never a reason to "
        "refuse: c and the shift in height are correlated by 0.9 and more in good flights.",
    )

    moved_sigmas: Positive = Field(
        default=1.0,
        description="A significant error of the model (see model_alternatives) that moves a calibrated "
        "parameter by more of its σ refuses the calibration; a smaller one restricts it.",
    )
    error_probability: Annotated[Real, Field(gt=0.0, lt=0.1)] = Field(
        default=0.001,
        description="Probability of refusing a good calibration by its check points, and by the second step.",
    )
    sigma0_factor: Annotated[Real, Field(gt=1.0)] = Field(
        default=1.5,
        description="σ0 of image points, control, GNSS and INS, each by itself, lies between this and its "
        "inverse; else their stated σ, and all that follow from them, are wrong.",
    )
    rejected_part: Annotated[Real, Field(gt=0.0, lt=1.0)] = Field(
        default=0.05, description="Part of the image points, control, GNSS or INS that may be rejected."
    )


class MountingSettings(Settings):
    """When strips count as flown with another mounting; they are reported and left out of the means.

    Flights differ if they do so significantly and by more than `calibration.limits` allows σ to be
    (boresight, lever arm); strips of one flight if by more than errors of GNSS and INS make strips differ, of
    which the σ of attitudes and `adjustment.priors.gnss_strip_bias_m` are stated.
    """

    error_probability: Annotated[Real, Field(gt=0.0, lt=0.5)] = Field(
        default=0.01,
        description="Probability of finding any other mounting when all strips have one; flights, parts of "
        "flights and single strips share it.",
    )


class HeldSigmas(Settings):
    """How well is known what is held: part of every σ of the certificate."""

    lever_arm_m: NotNegative = Field(default=0.01, description="σ of a lever arm that is held, each axis, m.")
    time_offset_s: NotNegative = Field(
        default=0.0002, description="σ of the times of the exposures against the positions, s."
    )
    refraction: NotNegative = Field(
        default=0.05, description="σ of the refraction that was corrected, part of it."
    )
    control_m: NotNegativeTriple | None = Field(
        default=None,
        description="σ of the datum of the control: what is common to all points, x, y, z, m; left out: as "
        "much as their own σ.",
    )


class CalibrationSettings(Settings):
    """The system calibration."""

    free: tuple[FreeParameter, ...] = Field(
        default=("boresight", "gnss_shift", "gnss_strip_bias", "focal_length", "principal_point"),
        description="What `aerocal calibrate` estimates, in the place of `adjustment.free`; additional "
        "parameters are those of `adjustment.self_calibration`. First mounting and GNSS are released, then "
        "the interior orientation, then additional parameters; what the flight does not determine is held. "
        "Strip biases of GNSS belong to it: taken for white noise, they make everything look better than "
        "it is.",
    )
    variance_components: bool = Field(
        default=True,
        description="Whether, where the stated σ hide no error of the model, the last adjustment estimates "
        "the σ of every group (adjustment.variance_components): the σ of the certificate then rest on what "
        "each group shows, not on one σ0 for all of them.",
    )
    two_step: bool = Field(
        default=True,
        description="Whether the block is also adjusted on control alone and the differences to GNSS and INS "
        "are averaged (two-step calibration), beside the one-step calibration in the adjustment.",
    )
    adjusted: ExposuresInput | None = Field(
        default=None,
        description="Orientations of another program's adjustment for the second step, in the place of an "
        "adjustment on control alone; written like `[inputs.exposures]`.",
    )
    mounting: MountingSettings = Field(
        default_factory=MountingSettings, description="When strips belong to another mounting."
    )

    held: HeldSigmas = Field(
        default_factory=HeldSigmas, description="How well is known what the calibration holds."
    )
    limits: AcceptanceLimits = Field(
        default_factory=AcceptanceLimits, description="What the flight must reach to be accepted."
    )
