"""manifest.json on object storage: the only pointer to results.

It is the manifest of an output folder with two additions: each file has the name of its object, and the whole
summary stands in it. One PUT replaces everything a reader goes by, so a reader sees the results of one run or
of another, never of both and never a part.
"""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import computed_field

from tasks.object_storage.stage_listing import Digest, PlainName, object_of
from tasks.storage.json_text import from_json
from tasks.storage.manifest import Manifest, ManifestEntry
from tasks.summary import Summary


class PublishedEntry(ManifestEntry):
    """A file of the results, and below the prefix the object it is."""

    file: PlainName
    sha256: Digest
    stage: PlainName
    key: Digest

    @computed_field  # type: ignore[prop-decorator]
    @property
    def object(self) -> str:
        """Name of its object, relative to the prefix."""
        return object_of(self.stage, self.key, self.sha256, self.file)


class PublishedManifest(Manifest):
    """The content of manifest.json on object storage.

    Attributes
    ----------
    artifacts : by name, the files of the results with their objects.
    summary : what stands in summary.json of the same run.
    """

    artifacts: Mapping[str, PublishedEntry]
    summary: Summary

    def of_folder(self) -> Manifest:
        """The manifest that the same results have in an output folder."""
        return Manifest.model_validate(self.model_dump())


def published_manifest_from(content: bytes) -> PublishedManifest | None:
    """Read a manifest; None if it is none."""
    try:
        return PublishedManifest.model_validate(from_json(content))
    except ValueError:
        return None
