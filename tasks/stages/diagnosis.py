"""The doctor's list: all mistakes of a delivery at once, with evidence and the line that corrects each.

Nothing is refused here. A run refuses input with which it cannot continue, and stops at the first mistake.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd

from adjust.approximate.intersection import intersect
from adjust.parameters import State
from tasks.block.block_input import block_of, image_point_observations, surveyed_points
from tasks.block.given_orientations import GivenOrientations
from tasks.block.oriented_images import oriented_images
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame
from tasks.errors import InputError
from tasks.files.json_text import JSON
from tasks.plausibility.control_diagnosis import Survey, diagnosed_control
from tasks.plausibility.coverage import other_pixel_origins, uncovered
from tasks.plausibility.declared_accuracy import expected_intersections, tie_limits
from tasks.plausibility.diagnosis import TieMisses, unexplained
from tasks.plausibility.hypotheses import of_orientations
from tasks.plausibility.misalignment import misalignment, misalignment_by_control
from tasks.plausibility.mistake import Mistake
from tasks.plausibility.moved_positions import DeclaredPositions, moved_positions, with_boresight
from tasks.plausibility.orientation_slips import Delivered
from tasks.plausibility.ray_residuals import flying_height
from tasks.plausibility.tie_mistakes import tie_mistakes
from tasks.settings.adjustment import AdjustmentSettings
from tasks.settings.cameras import CameraInput
from tasks.settings.inputs import ControlInput, ExposuresInput, ImagePointsInput
from tasks.settings.project import ProjectSettings
from tasks.settings.quality import ChecksSettings
from tasks.stages.approximate_values_stage import MOUNTINGS
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, write_notes
from tasks.store.store import stored
from tasks.tables.parquet import read_table
from tasks.tables.places import distinct


@stored("diagnosis")
def diagnose(
    folder: Path,
    *,
    exposures: Artifact,
    cameras: Artifact,
    image_points: Artifact,
    control_points: Artifact,
    project: ProjectSettings,
    checks: ChecksSettings,
    sources: tuple[ExposuresInput, ...],
    points_sources: tuple[ImagePointsInput, ...],
    control_sources: tuple[ControlInput, ...],
    camera_settings: dict[str, CameraInput],
    free: tuple[str, ...],
) -> None:
    """Write the mistakes that were found as the figure ``mistakes`` of notes.json."""
    map_frame = MapFrame.of(project.crs, project.heights)
    delivered, measured = read_table(exposures), read_table(image_points)
    control = read_table(control_points)
    mistakes = list(uncovered(delivered, measured, control))
    in_pixels = {source.file.name: source.format for source in points_sources if source.unit == "px"}
    origins = {name: camera.pixel_origin for name, camera in camera_settings.items()}
    mistakes += other_pixel_origins(in_pixels, origins)
    declared = _Declared(sources, control_sources, frozenset(free))
    try:
        oriented = oriented_images(delivered, read_table(cameras), measured, map_frame)
    except InputError:
        # Orientations are to be found from the image points: there is nothing given to doubt.
        oriented = None
    if oriented is not None:
        given, frame, _ = oriented
        if given.attitude_observed.any():
            # Attitudes from the track beside delivered ones are no mistake of the delivery.
            given = given.only(given.attitude_observed)
        reduced = delivered.set_index("image")["position"].reindex(given.image) == "projection_centre"
        positions = DeclaredPositions(reduced.to_numpy(bool), declared.free)
        block = _block(given, frame, measured)
        found, block = _by_ties(block, declared, positions, checks)
        mistakes = [*found, *_by_control(block, declared, control, map_frame, checks), *mistakes]
    figures: dict[str, JSON] = {"mistakes": [cast(JSON, asdict(mistake)) for mistake in mistakes]}
    write_notes(folder, Notes((), figures))


@dataclass(frozen=True)
class _Declared:
    """What the project file says."""

    exposures: tuple[ExposuresInput, ...]
    control: tuple[ControlInput, ...]
    free: frozenset[str]


@dataclass(frozen=True, eq=False)
class _Block:
    """Image points and orientations in one numbering."""

    delivered: Delivered
    state: State
    points: tuple[str, ...]
    frame: AdjustmentFrame


def _block(given: GivenOrientations, frame: AdjustmentFrame, measured: pd.DataFrame) -> _Block:
    own = measured[measured["image"].isin(given.image)]
    points = distinct(own["point"])
    rays, _ = image_point_observations(own, given.image, points, given.camera)
    block = block_of(frame, given, points, np.zeros((len(points), 3)), AdjustmentSettings())
    delivered = Delivered(given, rays)
    return _Block(delivered, block.approximate_state(), points, frame)


def _height(block: _Block) -> float:
    state = block.delivered.state(block.state)
    return flying_height(state, intersect(block.delivered.rays, state, len(block.points)))


def _by_ties(
    block: _Block, declared: _Declared, positions: DeclaredPositions, checks: ChecksSettings
) -> tuple[list[Mistake], _Block]:
    """Mistakes that the rays of tie points show, and the block without them."""
    delivered = block.delivered
    if not block.points:
        return [], block
    given = delivered.given
    limits = tie_limits(given, checks, _height(block))
    if not MOUNTINGS.isdisjoint(declared.free):
        turned = misalignment(given, delivered.rays, block.state, len(block.points), limits)
        given = given if turned is None else turned.given
        delivered = replace(delivered, given=given)
    misses = TieMisses(block.state)
    hypotheses = of_orientations(given, [source.angles for source in declared.exposures])
    found = tie_mistakes(delivered, misses, hypotheses, limits)
    settled = found.delivered
    if not MOUNTINGS.isdisjoint(declared.free):
        settled = with_boresight(settled, misses, limits.suspicious_px)
    mistakes = [*found.mistakes, *moved_positions(settled, misses, positions, limits.suspicious_px)]
    if not mistakes and limits.suspicious_px < found.left_px <= limits.wrong_px:
        mistakes.append(unexplained(found.left_px, limits))
    return mistakes, replace(block, delivered=found.delivered)


def _by_control(
    block: _Block, declared: _Declared, control: pd.DataFrame, map_frame: MapFrame, checks: ChecksSettings
) -> list[Mistake]:
    """Mistakes that the surveyed points show, with those corrected that the tie points show."""
    if len(control) == 0 or not block.points:
        return []
    survey = Survey(
        control,
        surveyed_points(control, map_frame, block.frame),
        block.points,
        map_frame,
        block.frame,
        _only({source.crs for source in declared.exposures}),
        _only({source.crs for source in declared.control}),
        all(source.angles.reference == "grid" for source in declared.exposures),
    )
    expected = expected_intersections(block.delivered.given, checks, _height(block))
    delivered = block.delivered
    as_read = delivered.order == "omega-phi-kappa" and not (delivered.turn - np.eye(3)).any()
    if as_read and not MOUNTINGS.isdisjoint(declared.free):
        given, place = delivered.given, survey.points.places_of_points(block.points)
        limits = tie_limits(given, checks, _height(block))
        turned = misalignment_by_control(given, delivered.rays, block.state, place, limits, expected.limit_m)
        delivered = delivered if turned is None else replace(delivered, given=turned.given)
    return diagnosed_control(delivered, block.state, survey, expected)


def _only(names: set[str]) -> str:
    return names.pop() if len(names) == 1 else ""
