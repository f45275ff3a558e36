"""From the settings of a simulation to the block it specifies: units, overlaps, and the frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adjust.camera.interior import FrameCamera
from adjust.geometry.earth import TopocentricFrame
from adjust.simulate.flight_plan import LineGroup, base_of, centre_from_start, spacing_of
from adjust.simulate.gross_errors import GrossErrorSpecification
from adjust.simulate.heads import HeadSpecification
from adjust.simulate.image_errors import ImageErrorSpecification
from adjust.simulate.noise import NoiseSpecification
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.random_streams import Source
from adjust.simulate.survey import SurveyLayout
from adjust.simulate.system import SystemSpecification
from adjust.simulate.terrain import TerrainShape
from adjust.simulate.trajectory import FlightVariation
from adjust.simulate.truth import BlockSpecification
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_frame
from tasks.errors import InputError
from tasks.settings.coordinates import ELLIPSOIDAL
from tasks.settings.simulated_truth import SimulatedNoise, SimulatedTruth
from tasks.settings.simulation import (
    FlightLines,
    SimulatedCamera,
    SimulatedControl,
    SimulatedHead,
    SimulatedProject,
    Simulation,
)

_MM = 1e-3
_UM = 1e-6
_SOURCES = {
    "image": Source.IMAGE_NOISE,
    "control": Source.CONTROL_NOISE,
    "gnss": Source.GNSS_WHITE,
    "gnss_markov": Source.GNSS_MARKOV,
    "ins": Source.INS_NOISE,
    "ins_markov": Source.INS_MARKOV,
}
Triple = tuple[float, float, float]


def block_specification(simulation: Simulation) -> BlockSpecification:
    """The block that a simulation specifies.

    Raises
    ------
    InputError
        If the CRS is not one that a project can have.
    """
    camera = certified_camera(simulation.camera)
    heads = tuple(certified_camera(head) for head in simulation.head)
    points, terrain = simulation.points, simulation.terrain
    return BlockSpecification(
        cameras=(camera, *heads),
        flight=tuple(_line_group(lines, camera) for lines in simulation.flight),
        points=PointSpecification(points.count, points.detection, points.min_rays, points.margin),
        noise=_noise(simulation.noise),
        survey=tuple(_survey_layout(layout) for layout in simulation.control),
        variation=FlightVariation(
            simulation.trajectory.position_m,
            _radians(simulation.trajectory.attitude_deg),
            float(np.deg2rad(simulation.trajectory.crab_deg)),
            _radians(simulation.trajectory.rate_deg_s),
            is_path=simulation.trajectory.sbet_hz is not None,
        ),
        terrain=TerrainShape(terrain.mean_m, terrain.relief_m, terrain.shortest_m, terrain.longest_m),
        system=_system(simulation.truth),
        image_errors=_image_errors(simulation.truth),
        gross_errors=_gross_errors(simulation.noise),
        frame=simulated_frame(simulation.project),
        seed=simulation.seed,
        heads=tuple(
            _head(number, head, of_platform=not simulation.camera.takes_pictures)
            for number, head in enumerate(simulation.head, start=1)
        ),
    )


def simulated_map_frame(project: SimulatedProject) -> MapFrame:
    """CRS and heights of the files.

    Raises
    ------
    InputError
        If the CRS is not one that a project can have.
    """
    frame = MapFrame.of(project.crs, ELLIPSOIDAL)
    if not (frame.is_local or frame.is_projected):
        raise InputError(
            f"The CRS {project.crs} is geographic, and results are in metres.",
            'Give a map projection, e.g. crs = "EPSG:25832", or "local".',
            entity="project.crs",
        )
    return frame


def simulated_frame(project: SimulatedProject) -> AdjustmentFrame:
    """The local frame: Cartesian, or topocentric at the given place."""
    map_frame = simulated_map_frame(project)
    if project.latitude_deg is None or project.longitude_deg is None:
        return local_frame(map_frame, np.zeros((1, 3)))
    place = np.deg2rad([project.latitude_deg, project.longitude_deg])
    return TopocentricFrame(map_frame.ellipsoid, float(place[0]), float(place[1]))


def certified_camera(camera: SimulatedCamera) -> FrameCamera:
    """The camera as its certificate has it."""
    x0, y0 = camera.principal_point_mm
    return FrameCamera(
        camera.name,
        camera.columns,
        camera.rows,
        camera.pixel_um * _UM,
        camera.focal_length_mm * _MM,
        (x0 * _MM, y0 * _MM),
        "corner",
        camera.mount_deg,
    )


def _head(number: int, head: SimulatedHead, *, of_platform: bool) -> HeadSpecification:
    return HeadSpecification(
        number,
        0,
        _radians(head.rotation_deg),
        head.position_m,
        head.synchronisation_offset_s,
        _radians(head.rotation_change_deg),
        head.position_change_m,
        head.synchronisation_offset_change_s,
        of_platform,
    )


def _line_group(lines: FlightLines, camera: FrameCamera) -> LineGroup:
    base = lines.base_m if lines.base_m is not None else base_of(camera, lines.height_m, lines.end_lap)
    spacing = lines.spacing_m
    if spacing is None:
        spacing = spacing_of(camera, lines.height_m, lines.side_lap)
    exposures, heading = lines.exposures_of_lines, float(np.deg2rad(lines.heading_deg))
    centre = lines.centre_m
    if lines.start_m is not None:
        centre = centre_from_start(lines.start_m, heading, exposures, base, spacing)
    return LineGroup(
        lines.name,
        lines.flight,
        0,
        heading,
        lines.height_m,
        exposures,
        base,
        spacing,
        lines.directions,
        centre,
        lines.speed_m_s,
    )


def _survey_layout(control: SimulatedControl) -> SurveyLayout:
    columns, rows, count = control.columns or 0, control.rows or 0, control.count or 0
    number = {"grid": columns * rows, "list": len(control.places_m)}.get(control.layout, count)
    as_control = control.control
    if as_control is None and control.check_fraction > 0.0:
        as_control = round(number * (1.0 - control.check_fraction))
    return SurveyLayout(
        control.layout,
        control.kind,
        columns,
        rows,
        count,
        control.places_m,
        as_control,
        control.margin,
        control.extent_m,
    )


def _noise(noise: SimulatedNoise) -> NoiseSpecification:
    return NoiseSpecification(
        image=noise.image_um * _UM,
        control=noise.control_m,
        gnss=noise.gnss_m,
        ins=_radians(noise.ins_deg),
        gnss_markov=noise.gnss_markov_m,
        gnss_correlation_time=noise.gnss_correlation_s,
        ins_markov=_radians(noise.ins_markov_deg),
        ins_correlation_time=noise.ins_correlation_s,
        level=noise.level,
        silent=frozenset(_SOURCES[name] for name in noise.silent),
    )


def _system(truth: SimulatedTruth) -> SystemSpecification:
    x0, y0 = truth.principal_point_change_mm
    return SystemSpecification(
        interior_change=(truth.focal_length_change_mm * _MM, x0 * _MM, y0 * _MM),
        boresight=_radians(truth.boresight_deg),
        lever_arm=truth.lever_arm_m,
        gnss_shift=truth.gnss_shift_m,
        gnss_shift_of_flight=truth.gnss_shift_of_flight_m,
        strip_bias=truth.strip_bias_m,
        strip_drift=truth.strip_drift_m_s,
        ins_strip_bias=_radians(truth.ins_strip_bias_deg),
        ins_drift=_radians(truth.ins_drift_deg_s),
        time_offset=truth.time_offset_s,
        refraction=truth.refraction,
    )


def _image_errors(truth: SimulatedTruth) -> ImageErrorSpecification:
    errors = truth.image_errors
    seams = None if errors.seams_mm is None else (errors.seams_mm[0] * _MM, errors.seams_mm[1] * _MM)
    return ImageErrorSpecification(
        errors.radial_um * _UM,
        errors.tile_um * _UM,
        errors.corner_um * _UM,
        seams,
        tuple((selection, size * _UM) for selection, size in errors.additional_um.items()),
    )


def _gross_errors(noise: SimulatedNoise) -> GrossErrorSpecification:
    wrong = noise.gross_errors
    smallest, largest = wrong.image_um
    return GrossErrorSpecification(
        wrong.image_rate,
        (smallest * _UM, largest * _UM),
        wrong.control_swaps,
        wrong.wrong_time_strips,
        wrong.time_error_s,
    )


def _radians(degrees: Sequence[float]) -> Triple:
    first, second, third = (float(value) for value in np.deg2rad(degrees))
    return first, second, third
