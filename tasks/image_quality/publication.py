"""Publish an examination of images: tables, page and summary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from tasks.files.json_text import JSON
from tasks.results.publish import OF_IMAGE_QUALITY, put_out
from tasks.results.quality_gates import GateResult
from tasks.results.summary import Summary, merged_figures, summary_of
from tasks.settings.image_quality import ImageQualitySettings
from tasks.settings.quality import Gates
from tasks.store.artifact import Artifact
from tasks.store.notes import read_notes
from tasks.store.stage_record import read_records, timings_s
from tasks.store.store import Store


def publish_image_quality(
    store: Store, settings: ImageQualitySettings, stages: Sequence[Mapping[str, Artifact]]
) -> Summary:
    """Put the files of the stages into the output folder."""
    notes = [read_notes(outputs["notes"]) for outputs in stages if "notes" in outputs]
    summary = summary_of(notes, Gates(), timings_s(read_records(store.folder)))
    gates = tuple(_gates(settings, merged_figures(notes)))
    status = "done" if all(gate.passed for gate in gates) else "gate_failed"
    summary = summary.model_copy(update={"gates": gates, "status": status})
    artifacts = [outputs[name] for outputs in stages for name in outputs if name in OF_IMAGE_QUALITY]
    put_out(store, settings, artifacts, summary, OF_IMAGE_QUALITY)
    return summary


def _gates(settings: ImageQualitySettings, figures: Mapping[str, JSON]) -> Iterator[GateResult]:
    """The limits of the sensor's sheets together, and those requested by the settings."""
    found: Mapping[str, Any] = figures
    if "sensor" in found:
        yield _count("missed_limits_of_sensor", len(found["sensor"]["missed"]))
    bands = found.get("image_quality", {}).get("bands", [])
    if settings.factor_max is not None:
        largest = max((band["factor"] for band in bands), default=None)
        passed = largest is not None and largest <= settings.factor_max
        yield GateResult(
            name="largest_factor", value=largest, limit=settings.factor_max, unit="px", passed=passed
        )
    counts = {
        "sharpened": sum(band["sharpened"] for band in bands),
        "drift": found.get("drift", {}).get("drifted", 0),
        "motion": found.get("smear_motion", {}).get("contradicting", 0),
    }
    yield from (_count(_NAMES[name], counts[name]) for name in settings.fail_on)


_NAMES = {"sharpened": "sharpened_bands", "drift": "drifted_quantities", "motion": "contradicting_smears"}


def _count(name: str, number: int) -> GateResult:
    return GateResult(name=name, value=float(number), limit=0.0, unit="1", passed=number == 0)
