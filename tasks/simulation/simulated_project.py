"""The project file of a simulated block."""

from __future__ import annotations

import math
from collections.abc import Mapping

from adjust.simulate.block import SimulatedBlock
from tasks.files.toml_text import TomlValue, toml_text
from tasks.settings.adjustment import FreeParameter
from tasks.settings.base import Settings
from tasks.settings.simulation import SimulatedCamera, SimulatedHead, Simulation
from tasks.simulation.simulated_sbet import trajectory_files
from tasks.simulation.simulation_input import simulated_map_frame


def project_text(simulation: Simulation, block: SimulatedBlock) -> str:
    """The text of project.toml: what a client would declare, and what the adjustment estimates."""
    opening = f"# A simulated block ({simulation.preset or 'own specification'}); its truth is in truth/.\n"
    content: dict[str, TomlValue] = {
        "version": 1,
        "project": {
            "name": simulation.project.name,
            "crs": simulation.project.crs,
            "heights": "ellipsoidal",
        },
        "cameras": {
            simulation.camera.name: _camera(simulation, simulation.camera),
            **{head.name: _camera(simulation, head) | _head(simulation, head) for head in simulation.head},
        },
        "inputs": _inputs(simulation, block),
        "adjustment": _adjustment(simulation, block),
    }
    for name in ("calibration", "burn_in", "gates", "sweep"):
        declared: Settings | None = getattr(simulation, name)
        if declared is not None:
            content[name] = declared.model_dump(mode="json", exclude_unset=True)
    return opening + toml_text(content)


def _camera(simulation: Simulation, camera: SimulatedCamera) -> dict[str, TomlValue]:
    seams = simulation.truth.image_errors.seams_mm
    # Where the CCD images meet is known of a camera; what they do wrong is not.
    tiles = {} if seams is None else {"tiles": _tiles(seams)}
    return {
        "columns": camera.columns,
        "rows": camera.rows,
        "pixel_um": camera.pixel_um,
        "focal_length_mm": camera.focal_length_mm,
        "principal_point_mm": camera.principal_point_mm,
        "pixel_origin": "corner",
        "mount_deg": camera.mount_deg,
        **tiles,
        **({} if simulation.film is None else {"fiducials_mm": dict(simulation.film.fiducials_mm)}),
    }


def _head(simulation: Simulation, head: SimulatedHead) -> dict[str, TomlValue]:
    return {
        "head": {
            "reference": simulation.camera.name,
            "rotation_deg": head.rotation_deg,
            "position_m": head.position_m,
            **({"synchronisation_offset_s": offset} if (offset := head.synchronisation_offset_s) else {}),
        }
    }


def _tiles(seams_mm: tuple[float, float]) -> Mapping[str, TomlValue]:
    x, y = seams_mm
    return {"seams_x_mm": [-x, x], "seams_y_mm": [-y, y]}


def _inputs(simulation: Simulation, block: SimulatedBlock) -> Mapping[str, TomlValue]:
    noise = simulation.noise
    place: dict[str, TomlValue] = {"crs": simulation.project.crs, "heights": "ellipsoidal"}
    inputs: dict[str, TomlValue] = {
        "image_points": {
            "file": "image_points.csv",
            "format": "csv",
            "unit": "mm",
            "sigma": round(noise.image_um * 1e-3, 9),
        },
        "exposures": _exposures(simulation, block)
        if simulation.trajectory.sbet_hz is None
        else _trajectories(simulation, block),
    }
    if simulation.film is not None:
        inputs["fiducials"] = {
            "file": "fiducials.csv",
            "format": "csv",
            "unit": "mm",
            "sigma": round(simulation.film.fiducial_um * 1e-3, 9),
        }
    if len(block.truth.surveyed):
        inputs["control"] = {"file": "control.csv", "format": "csv", **place, "sigma_m": noise.control_m}
    return inputs


def _exposures(simulation: Simulation, block: SimulatedBlock) -> TomlValue:
    noise, order = simulation.noise, simulation.project.angles
    turning: dict[str, TomlValue] = (
        {"rate_axes": "forward-right-down"} if any(simulation.trajectory.rate_deg_s) else {}
    )
    reference = "true-north" if order == "heading-pitch-roll" else "grid"
    return {
        "file": "exposures.csv",
        "format": "csv",
        "crs": simulation.project.crs,
        "heights": "ellipsoidal",
        "position": "antenna",
        "angles": {"order": order, "unit": "deg", "reference": reference, **turning},
        "sigma": {
            "position_m": [float(sigma) for sigma in block.specification.noise.stated_gnss],
            "attitude_deg": [
                math.hypot(white, markov)
                for white, markov in zip(noise.ins_deg, noise.ins_markov_deg, strict=True)
            ],
        },
    }


def _trajectories(simulation: Simulation, block: SimulatedBlock) -> TomlValue:
    """One input for each flight; the geographic CRS is that of the project's datum."""
    geographic = simulated_map_frame(simulation.project).crs.geodetic_crs
    code = None if geographic is None else geographic.to_authority()
    return [
        {
            "file": files.trajectory,
            "format": "sbet",
            "crs": ":".join(code) if code is not None else simulation.project.crs,
            "heights": "ellipsoidal",
            "position": "antenna",
            "flight": files.flight,
            "angles": {
                "order": "heading-pitch-roll",
                "unit": "rad",
                "reference": "true-north",
                "rate_axes": "forward-right-down",
            },
            "trajectory": {"time": "gps-week", "accuracy": files.accuracy},
            "events": {"file": files.events, "time": "gps-week"},
        }
        for files in trajectory_files(block)
    ]


def _adjustment(simulation: Simulation, block: SimulatedBlock) -> Mapping[str, TomlValue]:
    wrong, truth = block.measured.gross_errors, simulation.truth
    has_gross_errors = bool(len(wrong.image_points) or len(wrong.swapped) or len(wrong.strips))
    free = simulation.project.free if simulation.project.free is not None else free_parameters(simulation)
    adjustment: dict[str, TomlValue] = {
        "free": free,
        "refraction": "standard" if truth.refraction else "none",
        "rejection": {"critical_value": 4.13} if has_gross_errors else "none",
    }
    if simulation.project.observe is not None:
        adjustment["observe"] = simulation.project.observe
    # White noise in addition to it would need a model of its own; the correlation is then left unsaid.
    noise = simulation.noise
    if min(noise.gnss_markov_m) > 0.0 and not any(noise.gnss_m):
        adjustment["gnss_correlation_s"] = noise.gnss_correlation_s
    if min(noise.ins_markov_deg) > 0.0 and not any(noise.ins_deg):
        adjustment["ins_correlation_s"] = noise.ins_correlation_s
    priors: dict[str, TomlValue] = {}
    drawn: dict[FreeParameter, tuple[str, tuple[float, float, float]]] = {
        "gnss_strip_bias": ("gnss_strip_bias_m", truth.strip_bias_m),
        "gnss_drift": ("gnss_drift_m_s", truth.strip_drift_m_s),
        "ins_strip_bias": ("ins_strip_bias_deg", truth.ins_strip_bias_deg),
        "ins_drift": ("ins_drift_deg_s", truth.ins_drift_deg_s),
    }
    priors |= {key: sigma for name, (key, sigma) in drawn.items() if name in free and min(sigma) > 0.0}
    return {**adjustment, "priors": priors} if priors else adjustment


def free_parameters(simulation: Simulation) -> tuple[FreeParameter, ...]:
    """The system parameters whose truth differs from what the project states."""
    truth = simulation.truth
    differs: dict[FreeParameter, bool] = {
        "boresight": any(truth.boresight_deg),
        "lever_arm": any(truth.lever_arm_m),
        "gnss_shift": any(truth.gnss_shift_m) or any(map(any, truth.gnss_shift_of_flight_m.values())),
        "gnss_strip_bias": any(truth.strip_bias_m),
        "gnss_drift": any(truth.strip_drift_m_s),
        "ins_strip_bias": any(truth.ins_strip_bias_deg),
        "ins_drift": any(truth.ins_drift_deg_s),
        "time_offset": truth.time_offset_s != 0.0,
        "focal_length": truth.focal_length_change_mm != 0.0,
        "principal_point": any(truth.principal_point_change_mm),
        "relative_position": any(any(head.position_change_m) for head in simulation.head),
        "relative_rotation": any(any(head.rotation_change_deg) for head in simulation.head),
        "synchronisation_offset": any(head.synchronisation_offset_change_s for head in simulation.head),
    }
    return tuple(name for name, is_different in differs.items() if is_different)
