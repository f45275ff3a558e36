"""Whatever is in a file: every reader gives records or one clear error, never anything else."""

from __future__ import annotations

import random

import numpy as np
import pytest

from tasks.errors import InputError
from tasks.magnitude import HUGE
from tests.tasks.formats.packed_files import PACKED, packed
from tests.tasks.formats.sound_files import READERS, SOUND, content_of

LAUGHS = b'<!DOCTYPE a [<!ENTITY l "lol"><!ENTITY m "&l;&l;&l;&l;&l;&l;&l;&l;">]>'
PIECES = (
    b"", b"\x00", b"\r",
    b"\r\n", b"\n\n", b"\t", b" ", b",", b";", b"-99\n", b"nan",
    b"inf", b"1e308", b"-1e999",
    b"1_0", b"0x1F", b"1,5", b"9" * 400, b"\xff\xfe", b"\xe9",
    b"\xef\xbb\xbf", b"'", b'"', b"#", b"$END\n", b"<",
    b"</", b"&m;", LAUGHS, b"[" * 2_000, b"{", b"\xe2\x80\xae", "½".encode(), b"-1", b"1e-300", b"-",
)  # fmt: skip
WHOLE = (
    lambda content: content.replace(b"\n", b"\r\n"),
    lambda content: content.replace(b"\n", b"\r"),
    lambda content: b"\xef\xbb\xbf" + content,
    lambda content: content.decode("latin-1").encode("utf-16"),
    lambda content: content.replace(b".", b","),
    lambda content: content + content,
    lambda content: content[::-1],
)


class Thrown:
    """Where the damage comes from."""

    def __init__(self, seed: int):
        self._random = random.Random(seed)

    def number(self, low: int, high: int) -> int:
        return self._random.randint(low, high)

    def junk(self) -> bytes:
        return self._random.randbytes(self._random.randint(0, 8))


def damage(sound: bytes, chance: Thrown) -> bytes:
    """The sound file with up to four pieces put in, cut, or changed as a whole."""
    content = sound
    for _ in range(chance.number(0, 4)):
        begin = chance.number(0, len(content))
        length = chance.number(0, 12)
        piece = PIECES[chance.number(0, len(PIECES) - 1)] if chance.number(0, 1) else chance.junk()
        content = content[:begin] + piece + content[begin + length :]
    if chance.number(0, 1):
        content = content[: chance.number(0, len(content))]
    if chance.number(0, 3) == 0:
        content = WHOLE[chance.number(0, len(WHOLE) - 1)](content)
    return content


def refusal_or_records(reader, path, content):
    path.write_bytes(content)
    try:
        return None, reader(path)
    except InputError as error:
        return error, None


def check(reader, path, content):
    error, found = refusal_or_records(reader, path, content)
    if error is not None:
        assert error.what
        assert error.remedy
        assert len(str(error)) < 5_000
        return
    for records in found.values() if isinstance(found, dict) else [found]:
        for name in ("position", "angles", "xy", "time_s"):
            values = getattr(records, name, None)
            assert values is None or not (np.abs(values) > HUGE).any()
        if hasattr(records, "line"):
            assert len(records.line) == len(getattr(records, "image", getattr(records, "point", None)))


def test_every_reader_of_the_registers_has_a_sound_file():
    assert set(SOUND) == {(kind, name) for kind, readers in READERS.items() for name in readers}


@pytest.mark.parametrize("key", SOUND, ids="-".join)
def test_the_sound_file_is_read(key, tmp_path):
    path = tmp_path / "file"
    path.write_bytes(content_of(key))
    assert READERS[key[0]][key[1]](path)


@pytest.mark.parametrize("key", SOUND, ids="-".join)
def test_line_ends_and_a_byte_order_mark_change_nothing(key, tmp_path):
    kind, name = key
    if isinstance(SOUND[key], bytes):
        pytest.skip("a binary format has no lines")
    path = tmp_path / "file"
    found = []
    for change in (lambda content: content, *WHOLE[:3]):
        path.write_bytes(change(content_of(key)))
        records = READERS[kind][name](path)
        # A trajectory is known by its times; all others have the lines of their rows.
        rows = getattr(records, "line", getattr(records, "time_s", None))
        found.append(records if isinstance(records, dict) else rows.tolist())
    assert all(one == found[0] for one in found)


def check_damage(key, path, damaged_content, count):
    """Read so many damaged files; the content of one that breaks the reader is said."""
    for _ in range(count):
        content = damaged_content()
        try:
            check(READERS[key[0]][key[1]], path, content)
        except Exception as error:
            error.add_note(f"reading {content!r}")
            raise


@pytest.mark.parametrize("count", [20, pytest.param(10_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("key", SOUND, ids="-".join)
def test_damage_is_refused_or_read_but_never_a_crash(key, count, tmp_path):
    sound, chance = content_of(key), Thrown(list(SOUND).index(key))
    check_damage(key, tmp_path / "file", lambda: damage(sound, chance), count)


@pytest.mark.parametrize("count", [80, pytest.param(2_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("key", PACKED, ids="-".join)
def test_damage_within_a_packed_folder_is_refused_or_read(key, count, tmp_path):
    files = {name: content.encode() for name, content in PACKED[key].items()}
    names, chance = sorted(files), Thrown(list(PACKED).index(key))

    def damaged_folder() -> bytes:
        name = names[chance.number(0, len(names) - 1)]
        return packed({**files, name: damage(files[name], chance)})

    check_damage(key, tmp_path / "file", damaged_folder, count)
