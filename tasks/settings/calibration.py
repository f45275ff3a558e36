"""Settings of a system calibration: when its result is good enough to be used."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from tasks.settings.adjustment import FreeParameter
from tasks.settings.base import Settings
from tasks.settings.coordinates import NotNegative, NotNegativeTriple, Positive, Real, Whole
from tasks.settings.inputs import ExposuresInput


class AcceptanceLimits(Settings):
    """Limits for a calibration flight; standard deviations are computed with the given stochastic model."""

    focal_length_um: Positive = 2.0
    """σ of the focal length, µm."""
    principal_point_um: Positive = 1.0
    """σ of the principal point x, y, µm."""
    roll_pitch_deg: Positive = 0.0005
    """σ of boresight roll and pitch, degrees."""
    yaw_deg: Positive = 0.001
    """σ of boresight yaw, degrees."""
    shift_m: Positive = 0.03
    """σ of a GNSS shift x, y, z, m."""
    lever_arm_m: Positive = 0.03
    """σ of a lever arm x, y, z, m."""
    sigma_over_prior: Annotated[Real, Field(gt=0.0, le=1.0)] = 0.3
    """σ divided by the σ of the initial value; near 1, the flight has added no information, however small the
    correlations are.
    """
    weak_up_to: Annotated[Real, Field(ge=1.0)] = 3.0
    """Multiple of a limit up to which a parameter is rated weak; above it, not determinable."""
    headings: Annotated[Whole, Field(ge=1)] = 2
    """Required number of flight directions (opposite or crossing) if a principal point, a shift or a lever
    arm is calibrated.
    """
    height_ratio: Annotated[Real, Field(ge=1.0)] = 2.0
    """Required ratio of the highest to the lowest flying height above ground if a focal length, or a
    principal point together with a lever arm, is calibrated; 1: one height is sufficient if the σ are met.
    """
    correlation: Annotated[Real, Field(gt=0.0, lt=1.0)] = 0.95
    """Correlation of two calibrated parameters above which a warning is given. It is never a reason to
    refuse: c and the vertical shift are correlated by 0.9 and more in good flights.
    """

    moved_sigmas: Positive = 1.0
    """If a significant error of the model (see model_alternatives) changes a calibrated parameter by more
    than this multiple of its σ, the calibration is refused; if by less, restricted.
    """
    error_probability: Annotated[Real, Field(gt=0.0, lt=0.1)] = 0.001
    """Probability of refusing a good calibration by its check points, and by the second step."""
    sigma0_factor: Annotated[Real, Field(gt=1.0)] = 1.5
    """Required range of the σ0 of image points, control, GNSS and INS, each separately: between this factor
    and its inverse. Otherwise their stated σ, and all derived σ, are wrong.
    """
    rejected_part: Annotated[Real, Field(gt=0.0, lt=1.0)] = 0.05
    """Fraction of the image points, control, GNSS or INS that may be rejected."""


class MountingSettings(Settings):
    """Test for strips flown with another mounting; they are reported and excluded from the means.

    Flights differ if the difference is significant and larger than the σ allowed by `calibration.limits`
    (boresight, lever arm); strips of one flight if it exceeds the differences caused by errors of GNSS and
    INS, of which the σ of attitudes and `adjustment.priors.gnss_strip_bias_m` are stated.
    """

    error_probability: Annotated[Real, Field(gt=0.0, lt=0.5)] = 0.01
    """Probability of reporting another mounting although all strips have the same; divided among flights,
    parts of flights and single strips.
    """


class HeldSigmas(Settings):
    """Standard deviations of the parameters held fixed; included in every σ of the certificate."""

    lever_arm_m: NotNegative = 0.01
    """σ of a lever arm that is held fixed, each axis, m."""
    time_offset_s: NotNegative = 0.0002
    """σ of the exposure times relative to the positions, s."""
    refraction: NotNegative = 0.05
    """σ of the corrected refraction, as a fraction of it."""
    control_m: NotNegativeTriple | None = None
    """σ of the datum of the control, common to all points, x, y, z, m; default: equal to their own σ."""


class CalibrationSettings(Settings):
    """The system calibration."""

    free: tuple[FreeParameter, ...] = (
        "boresight",
        "gnss_shift",
        "gnss_strip_bias",
        "focal_length",
        "principal_point",
    )
    """System parameters estimated by `aerocal calibrate`, instead of `adjustment.free`; additional parameters
    are those of `adjustment.self_calibration`. Mounting and GNSS are estimated first, then the interior
    orientation, then additional parameters. Parameters that the flight does not determine are held fixed.
    Include the GNSS strip biases: if they are treated as white noise, all σ come out too small.
    """
    variance_components: bool = True
    """Whether the last adjustment estimates the σ of every group (adjustment.variance_components), provided
    that the tests find no error of the model. The σ of the certificate are then based on the residuals of
    each group, not on a single σ0.
    """
    two_step: bool = True
    """Whether, in addition to the one-step calibration, the block is adjusted with control points only and
    the differences to GNSS and INS are averaged (two-step calibration).
    """
    adjusted: ExposuresInput | None = None
    """Orientations of another program's adjustment for the second step, instead of an adjustment with control
    points only; same keys as `[inputs.exposures]`.
    """
    mounting: MountingSettings = Field(default_factory=MountingSettings)
    """Test whether strips have another mounting."""

    held: HeldSigmas = Field(default_factory=HeldSigmas)
    """Standard deviations of the parameters held fixed in the calibration."""
    limits: AcceptanceLimits = Field(default_factory=AcceptanceLimits)
    """Limits for acceptance of the flight."""
