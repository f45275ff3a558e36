"""Publish an examination of images: tables, page and summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tasks.results.publish import OF_IMAGE_QUALITY, put_out
from tasks.results.summary import Summary, summary_of
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
    artifacts = [outputs[name] for outputs in stages for name in outputs if name in OF_IMAGE_QUALITY]
    put_out(store, settings, artifacts, summary, OF_IMAGE_QUALITY)
    return summary
