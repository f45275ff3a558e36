"""calibration.json: what a system calibration has found, one record for each camera."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd

from adjust.calibration.flight_pattern import FlightPattern
from tasks.calibration.evidence import Evidence
from tasks.calibration.head_boresight import HeadBoresight, head_boresights, without_reference
from tasks.calibration.held_quantities import held_sigmas, with_held
from tasks.calibration.pattern_words import direction_words, flights_by_height, height_words
from tasks.calibration.record import (
    CalibratedCamera,
    CalibratedParameter,
    CalibrationFlight,
    CalibrationRecord,
    RecordedHeld,
)
from tasks.calibration.two_step_comparison import compared_steps, images_of_mountings
from tasks.calibration.verdicts import (
    REFUSED,
    RESTRICTED,
    FlightVerdict,
    ParameterVerdict,
    flight_verdict,
    parameter_verdicts,
)
from tasks.files.json_text import JSON
from tasks.quantities import is_calibrated, kind_of
from tasks.results.calibration_figures import (
    CalibrationFigures,
    CalibrationVerdictFigure,
    ReleaseFigure,
    StepComparisonFigure,
)
from tasks.results.figures import AdjustmentFigures, figures_of
from tasks.results.quality_gates import DIRECT, tested_gates
from tasks.results.summary import merged_figures
from tasks.settings.calibration import CalibrationSettings
from tasks.settings.cameras import CameraInput
from tasks.settings.inputs import Inputs
from tasks.settings.quality import Gates
from tasks.stages.judgement import recognised_pattern
from tasks.store.artifact import Artifact, digest_of_file
from tasks.store.notes import Notes, read_notes, write_notes
from tasks.store.store import stored
from tasks.tables.covariance import Key, correlation_pairs, covariance_of, sigmas_of
from tasks.tables.parquet import read_table

#: Beginning of the names of the files; one camera alone has no more than this.
CALIBRATION = "calibration"
_LONGEST_STEM = 100


@stored("calibration")
def describe_calibration(
    folder: Path,
    *,
    stages: tuple[Mapping[str, Artifact], ...],
    adjusted: Artifact,
    means: Artifact | None,
    releases: tuple[JSON, ...],
    remarks: tuple[str, ...],
    settings: CalibrationSettings,
    given: Mapping[str, CameraInput],
    inputs: Inputs,
    gates: Gates,
    crs: str,
    name: str,
    flown: date | None,
    software: Mapping[str, str],
) -> None:
    """Write a record for each camera, and notes with verdicts and the comparison with the second step.

    Parameters
    ----------
    stages : the outputs of all stages so far by name, in the order in which they ran.
    adjusted : notes of the adjustment.
    means : orientation_difference_means of the two-step calibration; None without one.
    releases : what was free at each stage and what was held after it, see `tasks.calibration.release`.
    remarks : sentences of the story, such as why there is no second step.
    given : cameras of the project file.
    gates : of the project file.
    name, flown : of the project.
    """
    outputs = {name: artifact for one in stages for name, artifact in one.items()}
    table, pairs = read_table(outputs["parameters"]), read_table(outputs["correlations"])
    sigmas = held_sigmas(settings.held, read_table(outputs["residuals"]))
    known = with_held(table, pairs, read_table(outputs["model_alternative_effects"]), sigmas)
    table, pairs = known.parameters, known.correlations
    images = read_table(outputs["images"])
    pattern = recognised_pattern(images)
    verdicts = dict(parameter_verdicts(table, pairs, pattern, settings.limits))
    held = _held(releases)
    verdicts |= {key: _refused(item, held) for key, item in verdicts.items()}
    steps = None
    if means is not None:
        mountings = images_of_mountings(read_table(outputs["orientation_differences"]), images)
        steps = compared_steps(table, pairs, read_table(means), mountings)
    summary = merged_figures([read_notes(adjusted)])
    figures = figures_of(summary)
    evidence = _evidence(stages, outputs, figures, gates, steps)
    by_gnss = any(item.group == "gnss_positions" for item in figures.groups)
    heads = heads_of_rigs(read_table(outputs["cameras"]), images)
    of_flight = flight_verdict(table, verdicts, pattern, settings.limits, by_gnss=by_gnss, heads=heads)
    of_flight = _with_held(of_flight, held)
    of_flight = of_flight.beside(*evidence.objections(settings.limits))
    by_height = flights_by_height(images, pattern)
    if (
        by_height is not None
        and "gnss_shift" in settings.free
        and any(
            item.parameter == "focal_length" and item.verdict == "not_determinable"
            for item in verdicts.values()
        )
    ):
        of_flight = of_flight.beside((by_height,), ())
    material = _Material(
        table,
        pairs,
        verdicts,
        of_flight,
        pattern,
        images,
        read_table(outputs["cameras"]),
        known.held,
        head_boresights(table, pairs, read_table(outputs["cameras"])),
    )
    files = [*inputs.input_files(), *(path for camera in given.values() for path in camera.input_files())]
    digests = {path.name: digest_of_file(path) for path in files}
    counts = {
        "object_points": outputs["object_points"].rows or 0,
        "image_points": outputs["image_points"].rows or 0,
        "control_points": int((read_table(outputs["control_residuals"])["status"] == "used").sum()),
    }
    used = sorted(material.images["camera"].unique())
    for camera in used:
        record = CalibrationRecord(
            camera=_camera(material.cameras, camera, given[camera]),
            parameters=_parameters(material, camera),
            covariance=_covariance(material, camera),
            held=known.held,
            flight=_flight(material, camera, name, crs, flown, counts),
            sigma0=float(str(summary["sigma0"])),
            redundancy=round(float(str(summary["redundancy"]))),
            verdict=of_flight.verdict,
            reasons=of_flight.reasons,
            restrictions=of_flight.restrictions,
            remarks=(
                *([material.boresights[camera].sentence] if camera in material.boresights else []),
                *of_flight.remarks,
                *remarks,
                *([steps.sentence] if steps is not None else []),
            ),
            inputs=digests,
            software=dict(software),
        )
        (folder / f"{file_stem(camera, alone=len(used) == 1)}.json").write_text(record.text, encoding="utf-8")
    problems = [
        *(f"{REFUSED}{reason}" for reason in of_flight.reasons),
        *(f"{RESTRICTED}{restriction}" for restriction in of_flight.restrictions),
    ]
    write_notes(
        folder,
        Notes(
            (*problems, *of_flight.remarks, *remarks),
            {CALIBRATION: _figures(material, releases, steps, remarks).to_json()},
        ),
    )


def file_stem(camera: str, *, alone: bool) -> str:
    """Name of a camera's record without its ending; two cameras never have the same."""
    if alone:
        return CALIBRATION
    plain = re.sub(r"[^A-Za-z0-9.-]+", "_", camera)[:_LONGEST_STEM]
    told_apart = "" if plain == camera else f"-{hashlib.sha256(camera.encode()).hexdigest()[:8]}"
    return f"{CALIBRATION}_{plain}{told_apart}"


@dataclass(frozen=True, eq=False)
class _Material:
    """What all records are made from."""

    parameters: pd.DataFrame
    correlations: pd.DataFrame
    verdicts: Mapping[Key, ParameterVerdict]
    of_flight: FlightVerdict
    pattern: FlightPattern
    images: pd.DataFrame
    cameras: pd.DataFrame
    held: tuple[RecordedHeld, ...]
    boresights: Mapping[str, HeadBoresight]


def heads_of_rigs(cameras: pd.DataFrame, images: pd.DataFrame) -> frozenset[str]:
    """Cameras that took images of the block together with others of their rig."""
    taken = cameras[cameras["camera"].isin(images["camera"])]
    rig = taken["head_of"].where(taken["head_of"].notna(), taken["camera"])
    return frozenset(taken["camera"][rig.duplicated(keep=False)])


def rows_of(parameters: pd.DataFrame, camera: str) -> pd.DataFrame:
    """Parameters of a camera and of the flights; those of strips are random and no part of a record."""
    own = parameters["camera"].isna() | (parameters["camera"] == camera)
    return parameters[own & parameters["parameter"].map(is_calibrated)]


def _rows(material: _Material, camera: str) -> pd.DataFrame:
    """Those of a record; boresight and lever arm of a head are those of its reference head."""
    rows = rows_of(material.parameters, camera)
    return without_reference(rows) if camera in material.boresights else rows


def _held(releases: tuple[JSON, ...]) -> dict[str, str]:
    """Families that were held because the flight did not determine them, with the reasons."""
    return {name: why for item in releases for name, why in ReleaseFigure.model_validate(item).held.items()}


def _refused(item: ParameterVerdict, held: Mapping[str, str]) -> ParameterVerdict:
    """The verdict of a parameter that was held in the end because it had not been determined before."""
    for family, reason in held.items():
        if kind_of(item.parameter) == family:
            return ParameterVerdict(item.parameter, item.entity, "not_determinable", reason)
    return item


def _with_held(verdict: FlightVerdict, held: Mapping[str, str]) -> FlightVerdict:
    if not held:
        return verdict
    reasons = tuple(f"{family} is held at its given value: {reason}" for family, reason in held.items())
    return verdict.beside(reasons, ())


def _evidence(
    stages: tuple[Mapping[str, Artifact], ...],
    outputs: Mapping[str, Artifact],
    adjusted: AdjustmentFigures,
    gates: Gates,
    steps: StepComparisonFigure | None,
) -> Evidence:
    """What the other stages have found."""
    notes = [read_notes(one["notes"]) for one in stages if "notes" in one]
    results, _ = tested_gates(gates, merged_figures(notes))
    direct = next((note.figures[DIRECT] for note in notes if DIRECT in note.figures), {})
    return Evidence(
        tuple(dict.fromkeys(sentence for note in notes for sentence in note.suspicions)),
        adjusted,
        read_table(outputs["residuals"]),
        read_table(outputs["images"]),
        cast(Mapping[str, Any], direct),
        results,
        steps,
    )


def _camera(cameras: pd.DataFrame, name: str, given: CameraInput) -> CalibratedCamera:
    (row,) = cameras[cameras["camera"] == name].to_dict("records")
    return CalibratedCamera(
        name=name,
        identity=given.identity,
        columns=int(row["columns"]),
        rows=int(row["rows"]),
        pixel_um=float(row["pixel_um"]),
        mount_deg=int(row["mount_deg"]),
        calibration_axes_deg=int(row["calibration_axes_deg"]),
    )


def _parameters(material: _Material, camera: str) -> tuple[CalibratedParameter, ...]:
    return tuple(
        CalibratedParameter(
            parameter=row["parameter"],
            entity=row["entity"],
            unit=row["unit"],
            value=row["value"],
            given=row["value"] - row["change"],
            sigma=_known(row["sigma"]),
            sigma_prior=_known(row["sigma_prior"]),
            status=row["status"],
            verdict=verdict.verdict,
            because=verdict.because,
        )
        for row in _rows(material, camera).to_dict("records")
        for verdict in (material.verdicts[row["parameter"], row["entity"]],)
    )


def _covariance(material: _Material, camera: str) -> tuple[tuple[float, ...], ...]:
    rows = _rows(material, camera)
    rows = rows[rows["sigma"].notna()]
    keys: list[Key] = list(zip(rows["parameter"], rows["entity"], strict=True))
    matrix = covariance_of(keys, sigmas_of(rows), correlation_pairs(material.correlations))
    return tuple(tuple(float(value) for value in row) for row in matrix)


def _flight(
    material: _Material, camera: str, name: str, crs: str, flown: date | None, counts: Mapping[str, int]
) -> CalibrationFlight:
    images = material.images[material.images["camera"] == camera]
    (row,) = material.cameras[material.cameras["camera"] == camera].to_dict("records")
    heights = tuple(round(float(height), 1) for height in material.pattern.heights)
    return CalibrationFlight(
        project=name,
        crs=crs,
        flown=flown,
        images=len(images),
        strips=len(images[["flight", "strip"]].drop_duplicates()),
        heights_m=heights,
        headings_deg=tuple(
            round(float(np.rad2deg(angle)) % 360.0, 1) for angle in material.pattern.directions
        ),
        gsd_m=tuple(
            float(f"{height * 1e-3 * row['pixel_um'] / row['focal_length_mm']:.3g}") for height in heights
        ),
        **counts,
    )


def _figures(
    material: _Material,
    releases: tuple[JSON, ...],
    steps: StepComparisonFigure | None,
    remarks: tuple[str, ...],
) -> CalibrationFigures:
    """For summary.json: verdicts, pattern, releases, and the comparison with the second step."""
    of_flight = material.of_flight
    return CalibrationFigures(
        verdict=of_flight.verdict,
        reasons=of_flight.reasons,
        restrictions=of_flight.restrictions,
        remarks=(*of_flight.remarks, *remarks),
        directions=direction_words(material.pattern),
        heights=height_words(material.pattern),
        parameters=tuple(
            CalibrationVerdictFigure(
                parameter=item.parameter,
                entity=item.entity,
                verdict=item.verdict,
                because=item.because,
                sigma=item.sigma,
                limit=item.limit,
                sigma_over_prior=item.sigma_over_prior,
                correlated_with=None if item.strongest is None else str(item.strongest),
                correlation=None if item.strongest is None else item.strongest.correlation,
            )
            for item in material.verdicts.values()
            if is_calibrated(item.parameter)
        ),
        held=tuple(item.model_dump() for item in material.held),
        releases=tuple(ReleaseFigure.model_validate(release) for release in releases),
        two_step=steps,
    )


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
