"""Angles of an exposure input: their unit, their order, and their reference axes.

What comes out is ω, φ, κ about the grid axes of the project, or heading, pitch, roll of the body against true
north at the exposure. Rotations are converted as matrices, exactly. Standard deviations go through the small
rotation δ = E · dα in the camera frame: Σ' = E'⁻¹ E Σ Eᵀ E'⁻ᵀ, of which the diagonal is kept.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adjust.arrays import Floats
from adjust.geometry.rotation import (
    ENU_FROM_NED,
    from_omega_phi_kappa,
    from_phi_omega_kappa,
    ned_from_body,
    omega_phi_kappa_jacobian,
    phi_omega_kappa_jacobian,
    to_heading_pitch_roll,
    to_omega_phi_kappa,
)
from tasks.coordinates.datum_change import Transfer
from tasks.deliveries.source_rows import Places
from tasks.errors import InputError, Location
from tasks.formats.records import ExposureRecords
from tasks.settings.coordinates import Angles

RADIANS_PER_UNIT = {"deg": np.pi / 180.0, "gon": np.pi / 200.0, "rad": 1.0}
_FULL_TURN = {"deg": 360.0, "gon": 400.0, "rad": 2.0 * np.pi}
# Values of a full turn may be exceeded by rounding only.
_SLACK = 1.0 + 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class ConvertedAngles:
    """Angles in degrees, (n, 3) each with sigmas; exactly one of the two kinds is given, the other is NaN.

    Attributes
    ----------
    omega_phi_kappa, sigma_omega_phi_kappa : about the grid axes of the project.
    heading_pitch_roll, sigma_heading_pitch_roll : of the body, against true north.
    """

    omega_phi_kappa: Floats
    sigma_omega_phi_kappa: Floats
    heading_pitch_roll: Floats
    sigma_heading_pitch_roll: Floats


def refuse_impossible_angles(records: ExposureRecords, declared: Angles, places: Places) -> None:
    """Raise if the angles cannot be in the declared unit: beyond a full turn, or the file says otherwise.

    Raises
    ------
    InputError
        Naming the first such row and the unit that would fit.
    """
    stated = records.declared_angle_unit
    if stated is not None and stated != declared.unit:
        raise InputError(
            f"The header of the file states its angles in {stated}, the project file in {declared.unit}.",
            f'Declare angles.unit = "{stated}".',
            file=records.file,
            declare=f'angles.unit = "{stated}"',
        )
    largest = np.nan_to_num(np.abs(records.angles)).max(axis=1)
    beyond = largest > _FULL_TURN[declared.unit] * _SLACK
    if not beyond.any():
        return
    row = int(np.argmax(largest))
    fitting = next((unit for unit in ("deg", "gon") if largest.max() <= _FULL_TURN[unit] * _SLACK), None)
    remedy = "Check the columns of the file."
    if fitting is not None:
        remedy = f'The values fit {fitting}: declare angles.unit = "{fitting}" if that is what they are.'
    error = places.error(
        row,
        f"The angle {largest[row]:.6g} is beyond a full turn of {_FULL_TURN[declared.unit]:.4g} "
        f"{declared.unit} ({int(beyond.sum())} rows).",
        remedy,
        str(records.image[row]),
    )
    raise replace(error, declare=None if fitting is None else f'angles.unit = "{fitting}"')


def body_rates(records: ExposureRecords, declared: Angles) -> Floats:
    """Rates (n, 3) of the body about its axes forward, right, down, degrees per second; NaN for none.

    Raises
    ------
    InputError
        If the file has rates and their axes are not declared, or the other way round.
    """
    given = records.rates is not None and bool(np.isfinite(records.rates).any())
    if given and declared.rate_axes is None:
        raise Location(records.file).error(
            "The file gives rates (rate_roll, rate_pitch, rate_yaw), but their axes are not declared.",
            'Declare angles.rate_axes = "forward-right-down" or "forward-left-up".',
        )
    if declared.rate_axes is not None and not given:
        raise Location(records.file).error(
            "The axes of rates are declared (angles.rate_axes), but the file contains no rates.",
            "Add the columns rate_roll, rate_pitch, rate_yaw, or leave rate_axes out.",
        )
    if records.rates is None:
        return np.full_like(records.angles, np.nan)
    to_degrees = 1.0 if declared.unit == "deg" else np.degrees(RADIANS_PER_UNIT[declared.unit])
    signs = (1.0, 1.0, 1.0) if declared.rate_axes == "forward-right-down" else (1.0, -1.0, -1.0)
    return np.asarray(records.rates * to_degrees * signs)


def unit_suspicion(records: ExposureRecords, declared: Angles) -> str | None:
    """A sentence if the range of the third angle is unusual for degrees."""
    heading = records.angles[:, 0] if declared.order == "heading-pitch-roll" else records.angles[:, 2]
    heading = heading[np.isfinite(heading)]
    if len(heading) == 0:
        return None
    low, high = float(heading.min()), float(heading.max())
    if declared.unit != "deg" or not (low < -180.0 * _SLACK or (low < 0.0 and high > 180.0 * _SLACK)):
        return None
    return (
        f"{records.file.name}: the angles declared as degrees run from {low:.1f} to {high:.1f}; degrees "
        "usually stay within ±180 or 0 to 360. They may be gon: check angles.unit."
    )


def convert_angles(
    records: ExposureRecords,
    declared: Angles,
    default_sigma_deg: tuple[float, float, float],
    transfer: Transfer,
    position: Floats,
    converted_position: Floats,
) -> ConvertedAngles:
    """Angles of an input as angles of the project.

    Parameters
    ----------
    records : the input's rows.
    declared : what its angles are.
    default_sigma_deg : for rows without sigmas: ω, φ, κ or roll, pitch, heading.
    transfer : from the input's frame into the project's.
    position, converted_position : (n, 3) in the two frames.
    """
    to_degrees = 1.0 if declared.unit == "deg" else np.degrees(RADIANS_PER_UNIT[declared.unit])
    angles, sigma = records.angles * to_degrees, records.sigma_angles * to_degrees
    heading_first = declared.order == "heading-pitch-roll"
    default = np.array(default_sigma_deg[::-1] if heading_first else default_sigma_deg)
    sigma = np.where(np.isnan(sigma), default, sigma)
    sigma[np.isnan(angles)] = np.nan
    nothing = np.full_like(angles, np.nan)
    if heading_first:
        angles = _true_heading(angles, declared, transfer, position)
        return ConvertedAngles(nothing, nothing, angles, sigma)
    if not (declared.order == "omega-phi-kappa" and declared.reference == "grid" and transfer.is_identity):
        angles, sigma = _project_grid(angles, sigma, declared, transfer, position, converted_position)
    return ConvertedAngles(angles, sigma, nothing, nothing)


def keep_their_axes(declared: Angles, transfer: Transfer) -> bool:
    """Whether the angles of an input equal those of the project at every position."""
    if declared.order == "heading-pitch-roll":
        return declared.reference != "grid" and transfer.keeps_datum
    return declared.reference == "grid" and transfer.is_identity


def _project_grid(
    angles: Floats, sigma: Floats, declared: Angles, transfer: Transfer, position: Floats, converted: Floats
) -> tuple[Floats, Floats]:
    """ω, φ, κ and their sigmas about the project's grid axes, degrees."""
    given = np.radians(angles)
    if declared.order == "phi-omega-kappa":
        rotation, jacobian = from_phi_omega_kappa(given), phi_omega_kappa_jacobian(given)
    else:
        rotation, jacobian = from_omega_phi_kappa(given), omega_phi_kappa_jacobian(given)
    if declared.reference == "grid":
        axes = transfer.target_grid_from_source_grid(position, converted)
    else:
        axes = transfer.target_grid_from_source_enu(position, converted)
    result = to_omega_phi_kappa(axes @ rotation)
    change = np.linalg.solve(omega_phi_kappa_jacobian(result), jacobian)
    return np.degrees(result), np.sqrt(np.einsum("nij,nj->ni", change**2, sigma**2))


def _true_heading(angles: Floats, declared: Angles, transfer: Transfer, position: Floats) -> Floats:
    """Heading, pitch, roll in degrees against true north in the project's datum."""
    if declared.reference == "grid":
        # An azimuth in the grid is the true one less the convergence.
        angles = angles + np.degrees(transfer.source.convergence(position))[:, None] * np.array(
            [1.0, 0.0, 0.0]
        )
    if transfer.keeps_datum:
        return angles
    source = ENU_FROM_NED @ ned_from_body(np.radians(angles))
    target = transfer.target_enu_from_source_enu(position) @ source
    return np.degrees(to_heading_pitch_roll(ENU_FROM_NED @ target))
