"""The burn-in protocol as a stage: ``burn_in_protocol.html``, ``.pdf`` and ``.json``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tasks.documents.certificate.burn_in import FILE, burn_in_content
from tasks.documents.certificate.documents import document_of, page_of, pdf_of
from tasks.documents.report.material import read_material
from tasks.files.json_text import JSON, json_text
from tasks.image_quality.radiometric_record import digest_of
from tasks.results.figures import figures_of
from tasks.settings.project import Project
from tasks.settings.published_sweep import PublishedTable
from tasks.stages.certificate import SOFTWARE
from tasks.store.artifact import Artifact
from tasks.store.notes import Notes, read_notes, write_notes
from tasks.store.store import stored
from tasks.tables.parquet import read_table


@stored("burn_in_protocol")
def write_burn_in_protocol(
    folder: Path,
    *,
    stages: tuple[Mapping[str, Artifact], ...],
    platform: Artifact,
    calibration: Artifact,
    project: Project,
    published: PublishedTable | None,
    software: Mapping[str, str] = SOFTWARE,
) -> None:
    """Write the protocol of a triangulation with virtual images.

    Parameters
    ----------
    stages : outputs of the stages of the triangulation by name, in the order in which they ran.
    platform : platform.parquet of the calibration.
    calibration : notes of the calibration, with its verdict.
    project : the settings of the triangulation; its gates are the limits.
    published : a protocol to compare with; None: without comparison.
    software : versions that decide how the documents look.
    """
    results, heads = read_material(stages, project), read_table(platform)
    digests: dict[str, JSON] = {
        name: artifact.sha256 for outputs in stages for name, artifact in outputs.items() if name != "notes"
    }
    code = digest_of(json_text({**digests, "platform": platform.sha256}))
    judged = figures_of(read_notes(calibration).figures).calibration
    assert judged is not None  # the notes of `describe_calibration` have it
    content = burn_in_content(results, heads, judged, published, code, software)
    (folder / f"{FILE}.html").write_text(page_of(content), encoding="utf-8")
    twin = {**document_of(content), "tables": digests}
    (folder / f"{FILE}.json").write_text(json_text(twin, indent=2) + "\n", encoding="utf-8")
    (folder / f"{FILE}.pdf").write_bytes(pdf_of(content))
    sigma0, redundancy = results.summary.sigma0_um or float("nan"), results.summary.redundancy or 0.0
    sentence = (
        f"The triangulation of the virtual images has σ0 {sigma0:.2f} µm with {redundancy:,.0f} degrees of "
        f"freedom. {content.sentence} See {FILE}.html."
    )
    write_notes(folder, Notes((sentence,)))
