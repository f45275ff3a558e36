"""The stage store: every stage's finished output, found by the key of its content.

``DIR/.store/STAGE/KEY/`` holds what one stage wrote for one key (`tasks.store.stage_key`). An output is
written into a temporary folder next to it, flushed to the disk and renamed, so a folder with a key
for a name is complete; it is never changed afterwards. ``stage.json`` in it lists the files with
their digests and says what the key was made of. A stored output is served only after all its
files were checked against their digests; a damaged one is computed again. A store may have a remote
side, which finished outputs are taken from and kept on for other machines.

    @stored("import_control")
    def import_control(folder: Path, *, sources: tuple[ControlInput, ...]) -> None: ...

    import_control(store, sources=...)      # {"control_points": Artifact(...), "notes": Artifact(...)}
"""

from __future__ import annotations

import contextlib
import errno
import inspect
import logging
import os
import secrets
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Concatenate, ParamSpec, cast

from tasks.files.delivered_file import keyed_by
from tasks.files.installation import writing_into
from tasks.files.json_text import JSON, read_json, replace_json
from tasks.store.artifact import (
    Artifact,
    artifact_names,
    artifact_of,
    digest_of_unchanged,
    forget_digests,
)
from tasks.store.notes import NOTES
from tasks.store.remote import Remote
from tasks.store.stage_key import InputFile, StageKey, differences, input_files, stage_key
from tasks.store.stage_record import StageRecord, clear_records, keep_record, read_records, utc_now

P = ParamSpec("P")
Outputs = dict[str, Artifact]

STAGE_FILE = "stage.json"
_UNFINISHED = ".unfinished-"
_DISCARDED = ".discarded-"
_READING = 0o555
#: What reading an output that is not as it was written may end with.
_DAMAGES = (OSError, ValueError, KeyError, TypeError)
_log = logging.getLogger("aerocal")


@dataclass(frozen=True)
class Store:
    """The finished stage outputs below one output folder.

    Attributes
    ----------
    folder : ``DIR/.store``.
    remote : where they are kept as well; None: nowhere.
    """

    folder: Path
    remote: Remote | None = None

    @classmethod
    def of(cls, directory: Path, remote: Remote | None = None) -> Store:
        """The store of the output folder `directory`."""
        return cls(directory.absolute() / ".store", remote)

    def begin_run(self) -> None:
        """Remove what killed runs left behind and forget the last run's records.

        Only for the holder of the run lock: a stage in work would lose its folder.

        Raises
        ------
        InstallationError
            If the folder cannot be written, or the remote side cannot be reached.
        """
        forget_digests()
        if self.remote is not None:
            self.remote.require_access()
        with writing_into(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            for leftover in self.leftovers():
                remove_whole(leftover)
            clear_records(self.folder)

    def leftovers(self) -> tuple[Path, ...]:
        """Files that killed runs and fetches have left behind; only valid while the run lock is held."""
        patterns = (f"*/{_UNFINISHED}*", f"*/{_DISCARDED}*")
        folders = [folder for pattern in patterns for folder in self.folder.glob(pattern)]
        # The last are published files that did not get their names any more.
        return (*folders, *self.folder.parent.glob(".*.[0-9]*.tmp"))

    def outputs(self, key: StageKey) -> Outputs | None:
        """The stored output of `key`, every file checked; None if there is none or it is damaged."""
        place = self._place(key)
        if not place.is_dir():
            return None
        try:
            outputs = _checked_outputs(place)
            _note_use(place)
            return outputs
        except _DAMAGES as error:
            _log.warning("%s: the stored output is damaged and is recomputed (%s)", key.stage, error)
            return None

    def taken_up(self, key: StageKey) -> Outputs | None:
        """The finished output of `key`, brought here if the remote side has it; None if there is none."""
        outputs = self.outputs(key)
        if self.remote is None:
            return outputs
        if outputs is None:
            return self._brought(key)
        # Left out by a run that was killed between computing and keeping it there, or damaged since.
        self.remote.put_missing(key, self._place(key))
        return outputs

    def reason_to_compute(self, key: StageKey) -> str:
        """In words, what has changed since the newest stored output of the same stage."""
        newest = self.newest(key.stage, without=key.digest)
        if newest is None:
            return "no earlier result"
        old = newest.get("key_parts")
        changed = differences(old, key.parts) if isinstance(old, Mapping) else ()
        return f"changed: {', '.join(changed)}" if changed else "no usable earlier result"

    def remarks(self) -> tuple[str, ...]:
        """The problems that the finished stages of the current run have noted, in their order, each once."""
        places = (self.folder / item.stage / item.key / NOTES for item in read_records(self.folder))
        sentences = (
            cast(Sequence[str], cast(Mapping[str, JSON], read_json(place))["problems"])
            for place in places
            if place.exists()
        )
        return tuple(dict.fromkeys(sentence for problems in sentences for sentence in problems))

    def newest(self, stage: str, without: str = "") -> Mapping[str, JSON] | None:
        """The list of a stage's newest output, except that of a key; None: there is none; empty: damaged."""
        folders = [path for path in (self.folder / stage).glob("[0-9a-f]*") if path.name != without]
        newest = max(folders, key=lambda path: path.stat().st_mtime_ns, default=None)
        try:
            return None if newest is None else cast(Mapping[str, JSON], read_json(newest / STAGE_FILE))
        except _DAMAGES:
            return {}

    def listed_digests(self) -> set[str]:
        """Digests of all files as finished outputs list them, whatever has become of the files."""
        digests = set[str]()
        for listing in self.folder.glob(f"*/[0-9a-f]*/{STAGE_FILE}"):
            with contextlib.suppress(*_DAMAGES):
                content = cast(Mapping[str, JSON], read_json(listing))
                entries = cast(list[Mapping[str, JSON]], content["files"])
                digests.update(str(entry["sha256"]) for entry in entries)
        return digests

    def keep(self, key: StageKey, folder: Path, seconds: float) -> Outputs:
        """Make a stage's finished folder the stored output of `key`: list it, flush it, rename it.

        Where another process has finished the same output meanwhile, that one stays: others may read it.
        """
        paths = sorted(folder.iterdir(), key=lambda path: path.name)
        names = artifact_names([path.name for path in paths])
        for path in paths:
            # From now on they do not change. Who may read them is said by the umask.
            path.chmod(path.stat().st_mode & _READING)
        # While the digests are made, the disk writes.
        with ThreadPoolExecutor(1) as disk, ThreadPoolExecutor(2) as digests:
            flushed = disk.map(_flush_file, paths)
            artifacts = list(digests.map(lambda path: artifact_of(path, names[path.name]), paths))
            list(flushed)
        files: list[JSON] = [
            {"file": a.path.name, "sha256": a.sha256, "rows": a.rows, "bytes": a.path.stat().st_size}
            for a in artifacts
        ]
        record: dict[str, JSON] = {
            "stage": key.stage,
            "key": key.digest,
            "key_parts": key.parts,
            "files": files,
            "seconds": round(seconds, 3),
        }
        replace_json(folder / STAGE_FILE, record)
        (folder / STAGE_FILE).chmod((folder / STAGE_FILE).stat().st_mode & _READING)
        _flush_folder(folder)
        place = self._place(key)
        while not _renamed(folder, place):
            with contextlib.suppress(*_DAMAGES):
                return _checked_outputs(place)
            remove_whole(place)
        _flush_folder(place.parent)
        return {a.name: Artifact(a.name, place / a.path.name, a.sha256, a.rows) for a in artifacts}

    def keep_remotely(self, key: StageKey) -> None:
        """Keep an output that has just been computed on the remote side, too."""
        if self.remote is not None:
            self.remote.put(key, self._place(key))

    def unfinished(self, key: StageKey) -> Path:
        """A new folder for the unfinished output of `key`."""
        # Not of `tempfile`, whose folders are closed to colleagues who work in the same output folder.
        folder = self.folder / key.stage / f"{_UNFINISHED}{secrets.token_hex(8)}"
        folder.mkdir(parents=True)
        return folder

    def _brought(self, key: StageKey) -> Outputs | None:
        assert self.remote is not None
        with writing_into(self.folder):
            folder = self.unfinished(key)
            try:
                seconds = self.remote.take(key, folder)
                return None if seconds is None else self.keep(key, folder, seconds)
            finally:
                shutil.rmtree(folder, ignore_errors=True)

    def _place(self, key: StageKey) -> Path:
        return self.folder / key.stage / key.digest


def stored(
    stage: str,
) -> Callable[[Callable[Concatenate[Path, P], None]], Callable[Concatenate[Store, P], Outputs]]:
    """Make a function that writes files into a folder a stage whose output is kept in a store.

    The decorated function takes a `Store` in place of the folder and keyword arguments only
    (artifacts, settings, tuples, lists and dicts of these, plain values; ``**tables`` for artifacts that are
    told apart by their names) and returns the artifacts it wrote by name
    (`tasks.store.artifact.artifact_names`). It computes nothing when the store has the
    output already.

    Raises
    ------
    TypeError
        When called with an argument whose content cannot be put into a key.
    InputError
        If an input file changed while the stage was reading it.
    InstallationError
        If the disk is full or the folder cannot be written.
    """

    def decorate(function: Callable[Concatenate[Path, P], None]) -> Callable[Concatenate[Store, P], Outputs]:
        signature = inspect.signature(function)

        @wraps(function)
        def run_stage(store: Store, /, *args: P.args, **kwargs: P.kwargs) -> Outputs:
            arguments = _bound(signature, args, kwargs)
            began, started = utc_now(), time.perf_counter()
            inputs = tuple(InputFile.of(path) for path in sorted(set(input_files(arguments))))
            with keyed_by({file.path: file.sha256 for file in inputs}):
                key = stage_key(stage, function, arguments)
                outputs = store.taken_up(key)
                reused = outputs is not None
                if outputs is None:
                    reason = store.reason_to_compute(key)
                    _log.info("%s: started (%s)", stage, reason, extra={"stage_began": stage})
                    with writing_into(store.folder):
                        outputs = _compute(store, key, function, arguments, inputs)
                    store.keep_remotely(key)
            seconds = time.perf_counter() - started
            done = "reused" if reused else "computed"
            _log.info("%s: %s in %.1f s", stage, done, seconds, extra={"stage_ended": stage})
            with writing_into(store.folder):
                keep_record(store.folder, StageRecord.of(key, outputs, reused, began, seconds, inputs))
            return outputs

        first, *others = signature.parameters.values()
        shown = [first.replace(name="store", annotation=Store), *others]
        vars(run_stage)["stage"] = stage
        vars(run_stage)["__signature__"] = signature.replace(parameters=shown, return_annotation=Outputs)
        return run_stage

    return decorate


def _bound(
    signature: inspect.Signature, args: tuple[object, ...], kwargs: Mapping[str, object]
) -> dict[str, object]:
    """All arguments of a stage by name, including defaults, which affect the result, too."""
    if args:
        raise TypeError("a stage takes the store and keyword arguments only")
    bound = signature.bind(None, **kwargs)
    bound.apply_defaults()
    return bound.kwargs


def _compute(
    store: Store,
    key: StageKey,
    function: Callable[..., None],
    arguments: Mapping[str, object],
    inputs: tuple[InputFile, ...],
) -> Outputs:
    """Run the stage in a folder of its own and keep what it wrote; nothing is left after an error."""
    folder = store.unfinished(key)
    started = time.perf_counter()
    try:
        function(folder, **arguments)
        for file in inputs:
            file.require_unchanged()
        return store.keep(key, folder, time.perf_counter() - started)
    finally:
        # After keep() the folder has its final name and there is nothing to remove.
        shutil.rmtree(folder, ignore_errors=True)


def _checked_outputs(place: Path) -> Outputs:
    """Read ``stage.json`` and check every file it lists.

    Raises
    ------
    ValueError
        If a file's bytes are not the ones that were written; OSError or KeyError if it is missing.
    """
    content = cast(Mapping[str, JSON], read_json(place / STAGE_FILE))
    outputs: Outputs = {}
    entries = cast(list[Mapping[str, JSON]], content["files"])
    names = artifact_names([str(entry["file"]) for entry in entries])
    for entry in entries:
        path = place / str(entry["file"])
        if path.parent != place or path.is_symlink():
            raise ValueError(f"{path} is not a file of this output")
        sha256, rows = str(entry["sha256"]), cast("int | None", entry["rows"])
        if digest_of_unchanged(path) != sha256:
            raise ValueError(f"{path.name} was changed after it had been written")
        name = names[path.name]
        outputs[name] = Artifact(name, path, sha256, rows)
    return outputs


def _renamed(folder: Path, place: Path) -> bool:
    """Give a finished folder its name; False where something has that name already."""
    try:
        folder.rename(place)
    except OSError as error:
        if error.errno in (errno.ENOTEMPTY, errno.EEXIST):
            return False
        raise
    return True


def remove_whole(place: Path) -> None:
    """Remove a folder or file, in one step as seen by other processes.

    A worker elsewhere may still be writing into a folder for a run that has ended: it loses the whole of it
    at once, and can never finish what is left.
    """
    if place.name.startswith(_DISCARDED):
        shutil.rmtree(place, ignore_errors=True)
        return
    if not place.is_dir():
        place.unlink(missing_ok=True)
        return
    aside = Path(tempfile.mkdtemp(prefix=_DISCARDED, dir=place.parent))
    with contextlib.suppress(FileNotFoundError):
        place.rename(aside / "output")
    shutil.rmtree(aside, ignore_errors=True)


def _note_use(place: Path) -> None:
    """Record the use of an output in the modification time of its list, which no digest covers."""
    # Where it may only be read, it is not cleaned up either.
    with contextlib.suppress(OSError):
        os.utime(place / STAGE_FILE)


def _flush_file(path: Path) -> None:
    with path.open("rb") as stream:
        os.fsync(stream.fileno())


def _flush_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
