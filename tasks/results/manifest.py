"""manifest.json: where every published file comes from.

For each artifact its digest, stage and key; for the run its settings, the delivered files with their
digests, library versions and times. Times, paths and hosts are recorded only here, so that the tables
of two runs can be compared byte for byte.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Self, cast

from pydantic import BaseModel, ValidationError, field_validator

from tasks.files.json_text import JSON, finite, read_json, replace_json
from tasks.results.summary import CONTRACT_VERSION
from tasks.settings.base import Settings
from tasks.store.artifact import Artifact
from tasks.store.stage_key import library_versions
from tasks.store.stage_record import StageRecord, utc_now

MANIFEST = "manifest.json"


class ManifestEntry(BaseModel, frozen=True):
    """One published file.

    Attributes
    ----------
    file : its name in the output folder.
    sha256, rows : digest of its bytes, and number of rows of a table.
    stage, key : the stage that made it and the key of that output in the store.
    """

    file: str
    sha256: str
    rows: int | None
    stage: str
    key: str

    @field_validator("file")
    @classmethod
    def _plain_name(cls, file: str) -> str:
        # A folder of results may have been delivered by somebody; its manifest leads nowhere else.
        if file in ("", ".", "..") or "/" in file or "\0" in file:
            raise ValueError("the file of an artifact lies in the output folder itself")
        return file


class StageEntry(BaseModel, frozen=True):
    """One stage of the run: its key, whether its output was reused, and the seconds it took."""

    stage: str
    key: str
    reused: bool
    seconds: float


class Manifest(BaseModel, frozen=True):
    """The content of manifest.json.

    Attributes
    ----------
    artifacts : by name, the published files; those of another kind of run in the same folder (a sweep beside
        an adjustment) stay, the other fields are about the last run.
    stages : what the stages did in this run, in the order in which they ended.
    inputs : path of each delivered file → digest of its bytes.
    settings : the project file (or its table) with all defaults.
    versions : of this software and the libraries that matter.
    times : ``started`` and ``finished``, ISO 8601, UTC.
    """

    contract_version: int
    artifacts: Mapping[str, ManifestEntry]
    stages: tuple[StageEntry, ...]
    inputs: Mapping[str, str]
    settings: Mapping[str, object]
    versions: Mapping[str, str]
    times: Mapping[str, str]

    def beside(self, other: Self, own: Collection[str]) -> Self:
        """The manifest with the files of other kinds of runs added: those whose names are not in `own`."""
        others = {name: entry for name, entry in other.artifacts.items() if name not in own}
        return self.model_copy(update={"artifacts": {**others, **self.artifacts}})

    def to_json(self) -> Mapping[str, JSON]:
        """The manifest as it is written: JSON without NaN."""
        return cast(Mapping[str, JSON], finite(cast(JSON, self.model_dump(mode="json"))))


def manifest_of(artifacts: Sequence[Artifact], project: Settings, records: Sequence[StageRecord]) -> Manifest:
    """Describe a finished run.

    Parameters
    ----------
    artifacts : the files to publish, as they lie in the store (``…/STAGE/KEY/file``).
    project : the project that was run, or the settings of a run without one.
    records : what its stages did; at least one.
    """
    return Manifest(
        contract_version=CONTRACT_VERSION,
        artifacts={_name(artifact, artifacts): _entry(artifact) for artifact in artifacts},
        stages=tuple(
            StageEntry(stage=record.stage, key=record.key, reused=record.reused, seconds=record.seconds)
            for record in records
        ),
        inputs={path: digest for record in records for path, digest in record.inputs.items()},
        settings=project.model_dump(mode="json"),
        versions={"aerocal": version("aerocal"), **library_versions()},
        times={"started": min(record.started for record in records), "finished": utc_now()},
    )


def write_manifest(directory: Path, manifest: Manifest) -> None:
    """Write manifest.json into the output folder, replacing the last one at once."""
    replace_json(directory / MANIFEST, manifest.to_json())


def read_manifest(directory: Path) -> Manifest | None:
    """The manifest of the last run; None if there is none or it cannot be read."""
    try:
        return Manifest.model_validate(read_json(directory / MANIFEST))
    except (OSError, ValueError, ValidationError):
        return None


def published_entry(file: Path) -> ManifestEntry | None:
    """What the manifest in its folder says of a file; None: nothing."""
    manifest = read_manifest(file.parent)
    entries = () if manifest is None else manifest.artifacts.values()
    return next((entry for entry in entries if entry.file == file.name), None)


def _name(artifact: Artifact, published: Sequence[Artifact]) -> str:
    """Its stem; the name of the file for a page next to a table of the same stem."""
    alone = sum(other.name == artifact.name for other in published) == 1
    return artifact.name if alone or artifact.path.suffix == ".parquet" else artifact.path.name


def _entry(artifact: Artifact) -> ManifestEntry:
    key_folder = artifact.path.parent
    return ManifestEntry(
        file=artifact.path.name,
        sha256=artifact.sha256,
        rows=artifact.rows,
        stage=key_folder.parent.name,
        key=key_folder.name,
    )
