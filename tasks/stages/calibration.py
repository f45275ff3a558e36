"""calibration.json: the result of a system calibration, one record for each camera or rig."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any, cast

import pandas as pd

from adjust.selection.significance import limit_of_t
from tasks.calibration.camera_record import Found, Origin, bodies, record_of
from tasks.calibration.evidence import Evidence
from tasks.calibration.head_boresight import head_boresights
from tasks.calibration.held_quantities import WithHeld, held_sigmas, with_held
from tasks.calibration.pattern_words import direction_words, flights_by_height, height_words
from tasks.calibration.two_step_comparison import compared_steps, images_of_mountings, several_mountings
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
from tasks.remarks.separability import weak_parameter_sentences
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
from tasks.tables.parquet import read_table

#: Beginning of the names of the files; one camera alone has no more than this.
CALIBRATION = "calibration"
_LONGEST_STEM = 100


@stored("calibration")
def describe_calibration(
    folder: Path,
    *,
    stages: tuple[Mapping[str, Artifact], ...],
    adjusted: tuple[Artifact, ...],
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
    """Write a record for each camera or rig, and notes with verdicts and the comparison with the second step.

    Parameters
    ----------
    stages : the outputs of all stages so far by name, in the order in which they ran.
    adjusted : notes of the adjustment, and of the remarks on it.
    means : orientation_difference_means of the two-step calibration; None without one.
    releases : what was free at each stage and what was held after it, see `tasks.calibration.release`.
    remarks : sentences of the story, such as why there is no second step.
    given : cameras of the project file.
    gates : of the project file.
    name, flown : of the project.
    """
    outputs = {name: artifact for one in stages for name, artifact in one.items()}
    images, cameras = read_table(outputs["images"]), read_table(outputs["cameras"])
    summary = merged_figures([read_notes(notes) for notes in adjusted])
    of_adjustment = figures_of(summary)
    redundancy = round(float(str(summary["redundancy"])))
    test = of_adjustment.global_test
    assert test is not None  # every adjustment has one
    known = _known(outputs, settings, limit_of_t(1.0 - test.confidence, redundancy))
    steps, mountings = None, dict[str, dict[int, int]]()
    if means is not None:
        mountings = images_of_mountings(read_table(outputs["orientation_differences"]), images)
        table, pairs = known.parameters, known.correlations
        steps = compared_steps(table, pairs, read_table(means), mountings)
    evidence = _evidence(stages, outputs, of_adjustment, gates, steps, several_mountings(mountings))
    found = _found(known, images, cameras, evidence, settings, _held(releases))
    origin = Origin(
        project=name,
        crs=crs,
        flown=flown,
        counts=_counts(outputs),
        inputs=digests_of_files(
            [*inputs.input_files(), *(path for camera in given.values() for path in camera.input_files())]
        ),
        software=software,
        sigma0=float(str(summary["sigma0"])),
        redundancy=redundancy,
        remarks=(*remarks, *_remark_on(steps, found.of_flight)),
    )
    calibrated = bodies(cameras, images)
    for names in calibrated:
        record = record_of(found, names, given, origin)
        stem = file_stem(names[0], alone=len(calibrated) == 1)
        (folder / f"{stem}.json").write_text(record.text, encoding="utf-8")
    verdict = found.of_flight
    reasons = (
        *(f"{REFUSED}{reason}" for reason in verdict.reasons),
        *(f"{RESTRICTED}{restriction}" for restriction in verdict.restrictions),
    )
    said = (*verdict.remarks, *remarks)
    figures = _figures(found, releases, steps, said)
    write_notes(folder, Notes((*reasons, *said), {CALIBRATION: figures.to_json()}, reasons=reasons))


def _remark_on(steps: StepComparisonFigure | None, verdict: FlightVerdict) -> tuple[str, ...]:
    """What the second step says, if it is no reason to refuse the calibration."""
    return () if steps is None or steps.sentence in verdict.reasons else (steps.sentence,)


def file_stem(camera: str, *, alone: bool) -> str:
    """Name of a camera's record without its ending; two cameras never have the same."""
    if alone:
        return CALIBRATION
    plain = re.sub(r"[^A-Za-z0-9.-]+", "_", camera)[:_LONGEST_STEM]
    told_apart = "" if plain == camera else f"-{hashlib.sha256(camera.encode()).hexdigest()[:8]}"
    return f"{CALIBRATION}_{plain}{told_apart}"


def _known(outputs: Mapping[str, Artifact], settings: CalibrationSettings, limit: float) -> WithHeld:
    """Parameters and correlations of the adjustment, with what was held in their σ."""
    parameters, correlations = read_table(outputs["parameters"]), read_table(outputs["correlations"])
    sigmas = held_sigmas(settings.held, read_table(outputs["residuals"]))
    effects = read_table(outputs["model_alternative_effects"])
    return with_held(parameters, correlations, effects, sigmas, limit)


def _found(
    known: WithHeld,
    images: pd.DataFrame,
    cameras: pd.DataFrame,
    evidence: Evidence,
    settings: CalibrationSettings,
    held: Mapping[str, str],
) -> Found:
    """Verdicts of the parameters and of the whole; a finding of any stage counts."""
    table, pairs = known.parameters, known.correlations
    pattern = recognised_pattern(images)
    judged = parameter_verdicts(table, pairs, pattern, settings.limits)
    verdicts = {key: _refused(item, held) for key, item in judged.items()}
    by_gnss = any(item.group == "gnss_positions" for item in evidence.adjusted.groups)
    heads = heads_of_rigs(cameras, images)
    of_flight = flight_verdict(table, pairs, verdicts, pattern, settings.limits, by_gnss=by_gnss, heads=heads)
    determined = {
        key for key, item in verdicts.items() if item.verdict == "determined" and is_calibrated(key[0])
    }
    others = weak_parameter_sentences(evidence.adjusted.weak_parameters, determined)
    of_flight = _with_held(replace(of_flight, remarks=(*of_flight.remarks, *others)), held)
    of_flight = of_flight.beside(*evidence.objections(settings.limits))
    by_height = flights_by_height(images, pattern)
    undetermined = {item.parameter for item in verdicts.values() if item.verdict == "not_determinable"}
    if by_height is not None and "gnss_shift" in settings.free and "focal_length" in undetermined:
        of_flight = of_flight.beside((by_height,), ())
    boresights = head_boresights(table, pairs, cameras)
    return Found(known, verdicts, of_flight, pattern, images, cameras, boresights)


def _counts(outputs: Mapping[str, Artifact]) -> Mapping[str, int]:
    return {
        "object_points": outputs["object_points"].rows or 0,
        "image_points": outputs["image_points"].rows or 0,
        "control_points": int((read_table(outputs["control_residuals"])["status"] == "used").sum()),
    }


def digests_of_files(paths: Iterable[Path]) -> Mapping[str, str]:
    """SHA-256 of files by name; files of the same name also have as many folders as tell them apart."""
    files = list(dict.fromkeys(paths))
    found = {}
    for path in files:
        others = [other for other in files if other != path and other.name == path.name]
        parts = next(
            parts
            for parts in (path.parts[-depth:] for depth in range(1, len(path.parts) + 1))
            if all(other.parts[-len(parts) :] != parts for other in others)
        )
        found["/".join(parts)] = digest_of_file(path)
    return found


def heads_of_rigs(cameras: pd.DataFrame, images: pd.DataFrame) -> frozenset[str]:
    """Cameras that took images of the block together with others of their rig."""
    taken = cameras[cameras["camera"].isin(images["camera"])]
    rig = taken["head_of"].where(taken["head_of"].notna(), taken["camera"])
    return frozenset(taken["camera"][rig.duplicated(keep=False)])


def _held(releases: tuple[JSON, ...]) -> dict[str, str]:
    """Families that were held because the flight did not determine them, with the reasons."""
    return {name: why for item in releases for name, why in ReleaseFigure.model_validate(item).held.items()}


def _refused(item: ParameterVerdict, held: Mapping[str, str]) -> ParameterVerdict:
    """The verdict of a parameter that was held in the end because it had not been determined before."""
    reason = held.get(kind_of(item.parameter))
    if reason is not None:
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
    mountings: tuple[str, ...],
) -> Evidence:
    """The evidence found by other stages."""
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
        mountings,
    )


def _figures(
    found: Found,
    releases: tuple[JSON, ...],
    steps: StepComparisonFigure | None,
    remarks: tuple[str, ...],
) -> CalibrationFigures:
    """For summary.json: verdicts, pattern, releases, and the comparison with the second step."""
    of_flight = found.of_flight
    return CalibrationFigures(
        verdict=of_flight.verdict,
        reasons=of_flight.reasons,
        restrictions=of_flight.restrictions,
        remarks=remarks,
        directions=direction_words(found.pattern),
        heights=height_words(found.pattern),
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
            for item in found.verdicts.values()
            if is_calibrated(item.parameter)
        ),
        held=tuple(item.model_dump() for item in found.known.held),
        releases=tuple(ReleaseFigure.model_validate(release) for release in releases),
        two_step=steps,
    )
