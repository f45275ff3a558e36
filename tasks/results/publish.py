"""Publish a run: the stages' finished files and the summary appear in the output folder.

The files are hard links into the store if the file system supports them, otherwise copies; each
appears under its name in one step. ``manifest.json`` is replaced last: its readers never see half a run.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from tasks.files.delivered_file import require_none_replaced
from tasks.files.installation import writing_into
from tasks.results.manifest import Manifest, manifest_of, published_entry, read_manifest, write_manifest
from tasks.results.own_files import require_own
from tasks.results.summary import Summary, summary_of, write_summary
from tasks.settings.base import Settings
from tasks.settings.project import Project
from tasks.store.artifact import Artifact, digest_of_file, verified
from tasks.store.notes import read_notes
from tasks.store.run_lock import require_in_place
from tasks.store.stage_record import read_records, timings_s
from tasks.store.store import Store

PUBLISHED = (
    "images",
    "cameras",
    "image_points",
    "film_orientations",
    "exposures",
    "trajectories",
    "control_points",
    "distances",
    "exterior_orientations",
    "neighbouring_images",
    "object_points",
    "residuals",
    "parameters",
    "correlations",
    "parameter_influences",
    "self_calibration",
    "model_alternatives",
    "model_alternative_effects",
    "control_residuals",
    "check_points",
    "distance_residuals",
    "residual_grid",
    "residual_autocorrelation",
    "trust_map_cells",
    "direct_georeferencing",
    "direct_georeferencing_models",
    "y_parallaxes",
    "stereo_models",
)
#: What a direct-georeferencing check without an adjustment publishes, next to what an adjustment left there.
OF_CHECKS = (
    "images",
    "cameras",
    "image_points",
    "exposures",
    "control_points",
    "direct_georeferencing",
    "direct_georeferencing_models",
    "y_parallaxes",
    "stereo_models",
    "georeferencing_check",
    "georeferencing_map",
)
#: What an examination of images publishes.
OF_IMAGE_QUALITY = (
    "edges",
    "edge_means",
    "edge_drift",
    "quality_drift",
    "smears",
    "smear_motion",
    "edge_responses",
    "noise_levels",
    "sensor_sheets",
    "defect_pixels",
    "defect_columns",
    "photon_transfer",
    "aperture",
    "image_quality",
    "radiometric_certificate.html",
    "radiometric_certificate.json",
    "radiometric_certificate.pdf",
)
#: Tables that other kinds of runs publish in their place.
OF_SWEEPS = ("sweep",)
#: Published besides the tables.
DOCUMENTS = (
    "report",
    "map",
    "trust_map",
    "georeferencing_check",
    "georeferencing_map",
    "certificate.html",
    "certificate.json",
    "certificate.pdf",
    "statements.html",
    "statements.json",
)
EVERYTHING = (*PUBLISHED, *DOCUMENTS)
#: What a system calibration publishes; the records of the cameras come with their own names.
OF_CALIBRATIONS = (
    *EVERYTHING,
    "orientation_differences",
    "orientation_difference_means",
    "platform",
    "virtual_image",
    "burn_in_protocol.html",
    "burn_in_protocol.json",
    "burn_in_protocol.pdf",
)

#: What every adjustment publishes, whatever its project requests.
OF_EVERY_ADJUSTMENT = (
    "images",
    "cameras",
    "image_points",
    "exposures",
    "control_points",
    "exterior_orientations",
    "object_points",
    "residuals",
    "parameters",
    "correlations",
    "report",
)
#: The same of a check without an adjustment, of a calibration of a single camera, and of the other kinds.
OF_EVERY_CHECK = ("images", "cameras", "image_points", "exposures", "control_points", "georeferencing_check")
OF_EVERY_CALIBRATION = (
    *OF_EVERY_ADJUSTMENT,
    "calibration",
    "certificate.html",
    "certificate.json",
    "certificate.pdf",
)
OF_EVERY_TWO_STEP_CALIBRATION = ("exposures", "cameras", "report")
OF_EVERY_SWEEP = (*OF_SWEEPS, "sweep.html")
OF_EVERY_EXAMINATION = ("image_quality",)


def require_replaceable(store: Store, names: Collection[str]) -> None:
    """Refuse a run at its beginning whose results would be refused at its end.

    Parameters
    ----------
    names : of what it will publish for certain.

    Raises
    ------
    InputError
        If the last run has published one of them here, and it was changed since.
    """
    directory = store.folder.parent
    last = read_manifest(directory)
    if last is not None:
        files = (entry.file for name, entry in last.artifacts.items() if name in names)
        require_own(directory, last, files, coming=())


def publish(
    store: Store,
    project: Project,
    stages: Sequence[Mapping[str, Artifact]],
    names: tuple[str, ...] = EVERYTHING,
) -> Summary:
    """Put the result of a run into the output folder.

    Parameters
    ----------
    store : the store of the output folder; its parent is where the files go.
    project : the project that was run; its gates are tested, its settings go into the manifest.
    stages : the outputs of the stages, in the order in which they ran.
    names : of everything that a run of this kind publishes.

    Returns
    -------
    summary : what is in summary.json.
    """
    notes = [read_notes(outputs["notes"]) for outputs in stages if "notes" in outputs]
    summary = summary_of(notes, project.gates, timings_s(read_records(store.folder)))
    artifacts = [outputs[name] for outputs in stages for name in outputs if name in names]
    put_out(store, project, artifacts, summary, names)
    return summary


def put_out(
    store: Store, project: Settings, artifacts: Sequence[Artifact], summary: Summary, own: Sequence[str]
) -> None:
    """Put files and summary into the output folder, the manifest last; then the remote side points to them.

    Parameters
    ----------
    own : names of everything that such a run may publish: what is there of them and was not made now is
        removed, unless somebody changed it. Files of other kinds of runs stay.

    Raises
    ------
    InputError
        If a file would replace one that the run has read, that is not by aerocal, or that was changed since.
        Nothing is written then.
    """
    directory = store.folder.parent
    require_in_place(directory)
    records = read_records(store.folder)
    names = [artifact.path.name for artifact in artifacts]
    inputs = {Path(path): digest for record in records for path, digest in record.inputs.items()}
    delivered = [path for path, digest in inputs.items() if not _left_here(directory, path, digest)]
    require_none_replaced((directory / name for name in names), delivered)
    with writing_into(directory):
        last = read_manifest(directory)
        require_own(directory, last, names, {artifact.sha256 for artifact in artifacts})
        for artifact in artifacts:
            _place(artifact, directory / artifact.path.name)
        made = manifest_of(artifacts, project, records)
        if last is not None:
            remove_outdated(directory, last, made, own)
        write_summary(directory, summary)
        write_manifest(directory, made if last is None else made.beside(last, own))
    if store.remote is not None:
        store.remote.publish(made.to_json(), summary.to_json(), own)


def _left_here(directory: Path, path: Path, digest: str) -> bool:
    """Whether an earlier run has published a file here that was read, as a check reads a calibration."""
    if path.resolve().parent != directory.resolve():
        return False
    entry = published_entry(path)
    return entry is not None and entry.sha256 == digest


def _place(artifact: Artifact, target: Path) -> None:
    """Make the artifact's bytes appear at `target` in one step."""
    source = verified(artifact)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    temporary.unlink(missing_ok=True)
    try:
        try:
            os.link(source, temporary)
        except OSError:
            # Another file system, or one without hard links.
            with temporary.open("xb") as copy, source.open("rb") as stream:
                shutil.copyfileobj(stream, copy)
        temporary.replace(target)
    finally:
        # Renaming one hard link onto another of the same file does nothing and leaves the first.
        temporary.unlink(missing_ok=True)


def remove_outdated(directory: Path, last: Manifest, manifest: Manifest, own: Sequence[str]) -> None:
    """Remove files that the previous run published and this one did not, unless they were changed."""
    for name in (last.artifacts.keys() - manifest.artifacts.keys()) & set(own):
        entry = last.artifacts[name]
        path = directory / entry.file
        if path.is_file() and digest_of_file(path) == entry.sha256:
            path.unlink()
