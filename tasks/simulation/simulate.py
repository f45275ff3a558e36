"""Write a simulated block as an ordinary project, with its truth next to it.

The project knows nothing of the simulation: it is what a client would deliver. The truth lies in
``truth/`` and is read by nobody but comparisons.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc

from adjust.arrays import Floats, Ints
from adjust.errors import InconsistentBlockError
from adjust.geometry import rotation
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.random_streams import RandomStreams, Source
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_from_grid, map_from_local
from tasks.errors import InputError, Location
from tasks.files.delivered_file import require_folder
from tasks.files.installation import InstallationError, writing_into
from tasks.settings.simulation import SimulatedFilm, Simulation
from tasks.simulation.simulated_project import project_text
from tasks.simulation.simulated_sbet import write_trajectories
from tasks.simulation.simulation_input import block_specification, simulated_frame, simulated_map_frame
from tasks.simulation.simulation_truth import SPECIFICATION, TRUTH, write_truth

# Digits after the point: enough that a project without noise gives the truth back.
_COORDINATE_DIGITS, _ANGLE_DIGITS, _IMAGE_DIGITS, _TIME_DIGITS = 9, 12, 9, 6


@dataclass(frozen=True)
class SimulatedFiles:
    """What was written.

    Attributes
    ----------
    project_file : the project.
    images, points, image_points, control, check : how many.
    """

    project_file: Path
    images: int
    points: int
    image_points: int
    control: int
    check: int


def simulate_project(simulation: Simulation, folder: Path) -> SimulatedFiles:
    """Simulate a block and write project.toml, its three input files and truth/ into a folder.

    The same simulation writes the same bytes.

    Raises
    ------
    InputError
        If the folder holds files that no simulation wrote, or the settings give no block.
    InstallationError
        If the disk is full or the folder cannot be written.
    """
    with writing_into(folder):
        _refuse_foreign(folder)
    try:
        block = simulate_block(block_specification(simulation))
    except InconsistentBlockError as error:
        raise InputError(str(error), "Change [flight] or [points].") from error
    if not len(block.truth.xy):
        raise InputError(
            "No point is measured in any image.",
            "Change [flight] or [points], or make the errors of [truth.image_errors] smaller.",
        )
    _refuse_missing_errors(simulation, block)
    _refuse_outside_area(simulation, block)
    before = set(folder.iterdir()) if folder.is_dir() else set()
    try:
        with writing_into(folder):
            _write(folder, simulation, block)
    except (InstallationError, OSError):
        _remove_new(folder, before)
        raise
    truth = block.truth
    check = int(truth.is_check.sum())
    return SimulatedFiles(
        folder / "project.toml",
        len(truth.images),
        len(truth.points),
        len(truth.xy),
        len(truth.surveyed) - check,
        check,
    )


def _write(folder: Path, simulation: Simulation, block: SimulatedBlock) -> None:
    map_frame, frame = simulated_map_frame(simulation.project), simulated_frame(simulation.project)
    (folder / TRUTH).mkdir(parents=True, exist_ok=True)
    # The project file comes last: a folder that was left half-written has none.
    (folder / "project.toml").unlink(missing_ok=True)
    write_truth(folder / TRUTH, simulation, block, map_frame, frame)
    film = film_of(simulation, block)
    _write_image_points(folder / "image_points.csv", block, film)
    _write_fiducials(folder / "fiducials.csv", block, film)
    if simulation.trajectory.sbet_hz is None:
        _write_exposures(folder / "exposures.csv", simulation, block, map_frame, frame)
    else:
        (folder / "exposures.csv").unlink(missing_ok=True)
        write_trajectories(folder, block, frame, simulation.trajectory.sbet_hz)
    _write_control(folder / "control.csv", block, map_frame, frame)
    (folder / "project.toml").write_text(project_text(simulation, block), encoding="utf-8")


def _refuse_missing_errors(simulation: Simulation, block: SimulatedBlock) -> None:
    """Refuse more gross errors than there is something to be wrong."""
    asked, made = simulation.noise.gross_errors, block.measured.gross_errors
    for key, number, possible in (
        ("control_swaps", asked.control_swaps, len(made.swapped)),
        ("wrong_time_strips", asked.wrong_time_strips, len(made.strips)),
    ):
        if number > possible:
            raise InputError(
                f"noise.gross_errors.{key} is {number}, and only {possible} are possible: a swap needs two "
                "full control points, a wrong time a strip.",
                f"Give at most {possible}.",
            )


def _refuse_outside_area(simulation: Simulation, block: SimulatedBlock) -> None:
    """Refuse a block whose positions no import accepts in the CRS: beyond its area, or over a pole."""
    map_frame, frame = simulated_map_frame(simulation.project), simulated_frame(simulation.project)
    positions = np.concatenate([block.measured.positions, block.measured.surveyed])
    known = positions[np.isfinite(positions).all(axis=1)]
    if not map_frame.inside_area_of_use(map_from_local(map_frame, frame, known)).all():
        latitude, longitude = simulation.project.latitude_deg, simulation.project.longitude_deg
        raise InputError(
            f"At latitude {latitude:g}, longitude {longitude:g} degrees the block is outside the "
            f"area of {map_frame.name}.",
            "Correct the place, or choose a CRS for it.",
            entity="project.crs",
        )


def _remove_new(folder: Path, before: set[Path]) -> None:
    """Remove what was written into a new folder before the disk was full."""
    if before or not folder.is_dir():
        return
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def _refuse_foreign(folder: Path) -> None:
    """Refuse to overwrite anything but a simulation."""
    require_folder(folder)
    if folder.is_dir() and any(folder.iterdir()) and not (folder / TRUTH / SPECIFICATION).is_file():
        raise Location(folder).error(
            "The folder is not empty, and no simulation wrote what is in it.", "Give --out a new folder."
        )


def film_of(simulation: Simulation, block: SimulatedBlock) -> DeformedFilm | None:
    """The film of a simulation; None for digital images."""
    if simulation.film is None:
        return None
    return deformed_film(simulation.film, len(block.truth.images), simulation.seed, simulation.noise.level)


def _write_fiducials(path: Path, block: SimulatedBlock, film: DeformedFilm | None) -> None:
    """fiducials.csv: marks as measured in the scans, mm."""
    if film is None:
        path.unlink(missing_ok=True)
        return
    images, marks = len(block.truth.images), len(film.marks)
    xy_mm = np.round(film.measured.reshape(-1, 2) * 1e3, _IMAGE_DIGITS)
    columns = {
        "image": _names(block.truth.images, np.repeat(np.arange(images), marks)),
        "point": _names(film.marks, np.tile(np.arange(marks), images)),
        "x": xy_mm[:, 0],
        "y": xy_mm[:, 1],
    }
    _write_csv(path, columns)


def _write_image_points(path: Path, block: SimulatedBlock, film: DeformedFilm | None) -> None:
    """image_points.csv: image system, mm; of film as measured in the scans."""
    truth = block.truth
    xy = block.measured.xy if film is None else film.scanned(truth.image, block.measured.xy)
    xy_mm = np.round(xy * 1e3, _IMAGE_DIGITS)
    columns = {
        "image": _names(truth.images, truth.image),
        "point": _names(truth.points, truth.point),
        "x": xy_mm[:, 0],
        "y": xy_mm[:, 1],
    }
    _write_csv(path, columns)


def _write_exposures(
    path: Path, simulation: Simulation, block: SimulatedBlock, map_frame: MapFrame, frame: AdjustmentFrame
) -> None:
    """exposures.csv: antenna positions in the project's CRS, angles in degrees."""
    plan = block.truth.plan
    positions = map_from_local(map_frame, frame, block.measured.positions)
    if simulation.project.angles == "heading-pitch-roll":
        names, angles = ("heading", "pitch", "roll"), _heading_pitch_roll(block, frame)[block.event_of_image]
    else:
        names = ("omega", "phi", "kappa")
        angles = _omega_phi_kappa(block, positions, map_frame, frame)
    # The heads of a rig share the reading of their event.
    own = block.event_of_image
    columns = {
        "image": pa.array(block.truth.images),
        "camera": _names(tuple(c.name for c in block.specification.cameras), block.truth.camera_of_image),
        "flight": _names(plan.flights, plan.flight[own]),
        "strip": _names(plan.strips, plan.strip[own]),
        "time": np.round(block.truth.trajectory.time[own], _TIME_DIGITS),
        **_xyz(np.round(positions[own], _COORDINATE_DIGITS)),
        **dict(zip(names, np.round(np.rad2deg(angles), _ANGLE_DIGITS).T, strict=True)),
    }
    if any(simulation.trajectory.rate_deg_s):
        rates = np.round(np.rad2deg(block.truth.trajectory.rate[own]), _ANGLE_DIGITS)
        columns |= dict(zip(("rate_roll", "rate_pitch", "rate_yaw"), rates.T, strict=True))
    _write_csv(path, columns)


def _heading_pitch_roll(block: SimulatedBlock, frame: AdjustmentFrame) -> Floats:
    """Heading, pitch, roll (n, 3) against true north at the observed positions, radians."""
    local_from_enu = np.asarray(frame.local_from_enu(block.measured.positions))
    enu_from_body = np.swapaxes(local_from_enu, 1, 2) @ block.measured.local_from_body
    angles = rotation.to_heading_pitch_roll(rotation.ENU_FROM_NED.T @ enu_from_body)
    angles[:, 0] %= 2.0 * np.pi
    return angles


def _omega_phi_kappa(
    block: SimulatedBlock, x_in_map: Floats, map_frame: MapFrame, frame: AdjustmentFrame
) -> Floats:
    """ω, φ, κ (n, 3) of the camera in its nominal mounting, against the grid, radians."""
    mounting = np.stack([camera.body_from_camera for camera in block.specification.cameras])
    grid_from_local = np.swapaxes(local_from_grid(map_frame, frame, x_in_map), 1, 2)
    own = block.event_of_image
    nominal = block.measured.local_from_body[own] @ mounting[block.truth.camera_of_image]
    return rotation.to_omega_phi_kappa(grid_from_local[own] @ nominal)


def _write_control(path: Path, block: SimulatedBlock, map_frame: MapFrame, frame: AdjustmentFrame) -> None:
    """control.csv: surveyed points; what is not known is left empty."""
    truth = block.truth
    position = map_from_local(map_frame, frame, block.measured.surveyed)
    position = np.where(truth.present, np.round(position, _COORDINATE_DIGITS), np.nan)
    columns = {
        "point": _names(truth.points, truth.surveyed),
        **_xyz(position),
        "role": _names(("control", "check"), truth.is_check.astype(np.int64)),
    }
    if len(truth.surveyed):
        _write_csv(path, columns)
    else:
        path.unlink(missing_ok=True)


def _xyz(values: Floats) -> dict[str, Floats]:
    return dict(zip("xyz", values.T, strict=True))


def _names(names: tuple[str, ...], index: Any) -> pa.Array:
    """Names (n,) of indices (n,)."""
    return pa.array(names, pa.string()).take(pa.array(index))


def _write_csv(path: Path, columns: Mapping[str, Any]) -> None:
    """Write columns; numbers with the fewest digits that give the same number back, NaN as nothing."""
    arrays = {
        name: values if isinstance(values, pa.Array) else pa.array(values, from_pandas=True)
        for name, values in columns.items()
    }
    options = pc.WriteOptions(quoting_style="none", quoting_header="none")
    pc.write_csv(pa.table(arrays), path, options)


_UM, _MM = 1e-6, 1e-3


@dataclass(frozen=True, eq=False)
class DeformedFilm:
    """The film of n images with k marks.

    Attributes
    ----------
    stretch, shift : (n, 2, 2), (n, 2) scan from camera, x_s = stretch x + shift; metres.
    marks : names of the marks.
    calibrated : (k, 2) coordinates in the camera, metres.
    measured : (n, k, 2) coordinates in the scan, with noise.
    """

    stretch: Floats
    shift: Floats
    marks: tuple[str, ...]
    calibrated: Floats
    measured: Floats

    def scanned(self, image: Ints, xy: Floats) -> Floats:
        """Coordinates (m, 2) in the scan of points (m, 2) in the images (m,)."""
        return np.asarray(np.einsum("mij,mj->mi", self.stretch[image], xy) + self.shift[image])

    @property
    def coefficients(self) -> Floats:
        """(n, 2, 3) true transformation to the camera: a0, a1, a2 and b0, b1, b2, metres."""
        back = np.linalg.inv(self.stretch)
        return np.concatenate([-np.einsum("nij,nj->ni", back, self.shift)[:, :, None], back], axis=2)


def deformed_film(film: SimulatedFilm, images: int, seed: int, level: float) -> DeformedFilm:
    """The film of a simulation; `level` is a factor of the noise of the marks, not of the deformation."""
    streams = RandomStreams(seed)
    drawn = streams.of(Source.FILM).standard_normal((images, 6))
    own = drawn[:, :4].reshape(-1, 2, 2) * film.affine_ppm * 1e-6
    stretch = np.eye(2) * (1.0 - film.shrinkage_ppm * 1e-6) + own
    shift = drawn[:, 4:] * film.shift_mm * _MM
    calibrated = np.array(list(film.fiducials_mm.values()), dtype=np.float64) * _MM
    placed = np.einsum("nij,kj->nki", stretch, calibrated) + shift[:, None]
    noise = streams.of(Source.FIDUCIAL_NOISE).standard_normal(placed.shape) * film.fiducial_um * _UM
    return DeformedFilm(stretch, shift, tuple(film.fiducials_mm), calibrated, placed + level * noise)
