"""Where the report comes from: settings with all defaults, delivered files with digests, versions.

Times, hosts and folders are not here, because the same inputs must give the same report byte for byte; they
are in manifest.json.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version

from tasks.document_kit.table import Row, Table, text_column
from tasks.files.json_text import JSON, json_text
from tasks.settings.base import Settings
from tasks.settings.project import Project
from tasks.store.artifact import digest_of_file
from tasks.store.stage_key import library_versions

#: Versions that decide how the report looks, besides those of the numerical libraries.
SOFTWARE: Mapping[str, str] = {name: version(name) for name in ("aerocal", "jinja2", "markupsafe")}


def computed_with() -> Mapping[str, str]:
    """Versions on which numbers depend: ours, and those in the key of every stage."""
    return {"aerocal": SOFTWARE["aerocal"], **library_versions()}


def delivered_names(project: Project) -> tuple[str, ...]:
    """Names of the delivered files, without their folders, in the order of the settings."""
    return tuple(path.name for path in project.input_files())


def settings_table(project: Settings) -> Table:
    """Every setting by its dotted key; files by the beginning of their digest."""
    rows = tuple(Row(key, (key, value)) for key, value in _flat("", project.key_content()))
    columns = (text_column("setting", "setting"), text_column("value", "value"))
    return Table("settings", "Settings, defaults included", columns, rows)


def files_table(project: Settings, names: Sequence[str]) -> Table:
    """Delivered files and their digests."""
    columns = (text_column("file", "file"), text_column("sha256", "sha256"))
    digests = [digest_of_file(path) for path in project.input_files()]
    distinct = dict.fromkeys(zip(names, digests, strict=True))
    rows = tuple(Row(f"{name}@{digest}", (name, digest)) for name, digest in distinct)
    return Table("files", "Delivered files", columns, rows)


def versions_table(software: Mapping[str, str]) -> Table:
    """Versions of this software and of the libraries a result may depend on."""
    everything = {**software, **library_versions()}
    columns = (text_column("name", "software"), text_column("version", "version"))
    rows = tuple(Row(name, (name, everything[name])) for name in everything)
    return Table("versions", "Versions", columns, rows)


def _flat(prefix: str, value: JSON) -> Iterator[tuple[str, str]]:
    """Leaves of nested settings as (dotted key, text)."""
    if isinstance(value, Mapping) and set(value) == {"sha256"}:
        yield prefix, f"file {str(value['sha256'])[:12]}…"
    elif isinstance(value, Mapping) and value:
        for key, item in value.items():
            yield from _flat(f"{prefix}.{key}" if prefix else key, item)
    elif (
        isinstance(value, Sequence)
        and not isinstance(value, str)
        and any(isinstance(v, Mapping) for v in value)
    ):
        for index, item in enumerate(value):
            yield from _flat(f"{prefix}[{index}]", item)
    else:
        yield prefix, "none" if value is None else value if isinstance(value, str) else json_text(value)
