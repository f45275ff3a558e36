"""Names nobody can read are refused where they come in; all others are kept verbatim."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.formats.native_csv import read_csv_control, read_csv_image_points
from tasks.plain_text import LONGEST_NAME, trouble_in, trouble_in_tables, visible
from tasks.settings.load import load_project

UNSEEN = {
    "escape sequence of a terminal": "a\x1b[2Jb",
    "null": "a\x00b",
    "line end": "a\nb",
    "C1 control": "a\x9bb",
    "right-to-left override": "a\u202egnp.exe",
    "isolate": "a\u2067b",
    "line separator": "a\u2028b",
    "noncharacter": "a\uffffb",
}
ORDINARY = (
    '<script>alert("x")</script>', "'; DROP TABLE calibrations; --", "=1+1", "../../x", "Bild 7 ü", "影像٣",
    "👩‍🚀", "אבג", "#read(\"/etc/passwd\")", "a" * LONGEST_NAME,
)  # fmt: skip


@pytest.mark.parametrize("name", ORDINARY)
def test_ordinary_characters_of_any_script_and_language_are_kept_verbatim(name: str, tmp_path: Path) -> None:
    assert trouble_in(name) is None
    file = tmp_path / "points.csv"
    quoted = '"' + name.replace('"', '""') + '"'
    file.write_text(f"image,point,x,y\n{quoted},{quoted},1,2\n", encoding="utf-8")
    records = read_csv_image_points(file)
    assert records.image.to_pylist() == records.point.to_pylist() == [name]


@pytest.mark.parametrize("name", UNSEEN.values(), ids=UNSEEN)
def test_an_unseen_character_in_a_table_is_refused_with_its_line(name: str, tmp_path: Path) -> None:
    file = tmp_path / "points.csv"
    for reader, header, row in (
        (read_csv_image_points, "image,point,x,y", '"{}",p,1,2'),
        (read_csv_control, "point,x,y,z", '"{}",1,2,3'),
    ):
        file.write_text(
            f"{header}\n{row.format('sound')}\n{row.format(name)}\n", encoding="utf-8", newline=""
        )
        with pytest.raises(InputError) as refused:
            reader(file)
        assert visible(str(refused.value)) == str(refused.value)
        if "\x00" not in name:
            assert refused.value.line == 3
            assert f"U+{ord(next(c for c in name if visible(c) != c)):04X}" in str(refused.value)


@pytest.mark.parametrize("name", UNSEEN.values(), ids=UNSEEN)
@pytest.mark.parametrize("place", ["name", "camera"])
def test_an_unseen_character_in_a_project_file_is_refused_with_its_key(
    name: str, place: str, tmp_path: Path, write_project: Callable[..., Path]
) -> None:
    project = write_project(tmp_path)
    escaped = "".join(c if visible(c) == c else f"\\u{ord(c):04x}" for c in name)
    old, new = ('"small"', f'"{escaped}"') if place == "name" else ("[cameras.C]", f'[cameras."{escaped}"]')
    text = project.read_text()
    assert old in text
    project.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match="invisible character") as refused:
        load_project(project)
    assert visible(str(refused.value)) == str(refused.value)
    # A name that is written with escapes is not found again in the text.
    assert (refused.value.line is not None) == (place == "name")
    assert refused.value.entity == ("project.name" if place == "name" else f"cameras.{name}")


def test_very_long_names_are_refused_and_not_repeated(
    tmp_path: Path, write_project: Callable[..., Path]
) -> None:
    long = "x" * (LONGEST_NAME + 1)
    file = tmp_path / "points.csv"
    file.write_text(f"image,point,x,y\n{long},p,1,2\n")
    with pytest.raises(InputError, match="256 characters, more than 255") as refused:
        read_csv_image_points(file)
    assert len(str(refused.value)) < 400
    project = write_project(tmp_path)
    for old, new in (('"small"', f'"{long}"'), ("[cameras.C]", f"[cameras.{long}]")):
        text = project.read_text()
        project.write_text(text.replace(old, new))
        with pytest.raises(InputError, match="255"):
            load_project(project)
        project.write_text(text)


def test_a_message_shows_what_a_terminal_would_obey_and_stays_short() -> None:
    error = InputError(
        "'a\x1b]0;x\x07' is wrong.", "y" * 10_000, file=Path("/tmp/\x1b[31m"), entity="b\u202ec"
    )
    assert str(error).startswith(r"/tmp/\u001b[31m: b\u202ec: 'a\u001b]0;x\u0007' is wrong.")
    assert len(str(error)) < 2_100


def test_the_first_unreadable_text_of_nested_tables_is_named() -> None:
    assert trouble_in_tables({"a": [{"b": "sound"}, 1, None]}) is None
    place, trouble = trouble_in_tables({"a": [{"b": "sound"}, {"b": "\x07"}]}) or ((), "")
    assert place == ("a", 1, "b")
    assert "U+0007" in trouble
    assert trouble_in_tables({"a": {"\x07": 1}})[0] == ("a", "\x07")  # type: ignore[index]


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 100_000,
        "a = " + "{ b = " * 100_000,
        "[" + ".".join("a" * 50_000) + "]\n",
        ".".join("a" * 50_000) + " = 1\n",
        " . ".join(['"a"'] * 50_000) + " = 1\n",
        "a = " + "1" * 5_000,
    ],
    ids=["arrays", "inline tables", "header", "dotted key", "quoted dotted key", "number"],
)
def test_a_project_file_nested_without_end_is_refused(text: str, tmp_path: Path) -> None:
    file = tmp_path / "project.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=r"nested too deeply|not valid TOML") as refused:
        load_project(file)
    assert len(str(refused.value)) < 500
