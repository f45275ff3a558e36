"""XML bombs and external entities are refused before a parser sees them, whatever its version."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.formats.ign_camera import read_ign_camera

SENSOR = """
<sensor><usefull-frame><rect><w>100</w><h>80</h></rect></usefull-frame><pixel_size>5e-6</pixel_size>
<focal><pt3d><x>50</x><y>40</y><z>{z}</z></pt3d></focal></sensor>
"""
LAUGHS = "".join(f'<!ENTITY l{k} "{f"&l{k - 1};" * 10}">' for k in range(1, 10))
ATTACKS = {
    "billion laughs": f'<!DOCTYPE sensor [<!ENTITY l0 "lol">{LAUGHS}]>' + SENSOR.format(z="&l9;"),
    "quadratic blow-up": f'<!DOCTYPE sensor [<!ENTITY a "{"1" * 100_000}">]>'
    + SENSOR.format(z="&a;" * 50_000),
    "external entity": '<!DOCTYPE sensor [<!ENTITY a SYSTEM "file:///etc/hostname">]>'
    + SENSOR.format(z="&a;"),
    "external parameter entity": '<!DOCTYPE sensor [<!ENTITY % a SYSTEM "file:///etc/hostname"> %a;]>'
    + SENSOR.format(z="100"),
    "external document type": '<!DOCTYPE sensor SYSTEM "http://127.0.0.1/x.dtd">' + SENSOR.format(z="100"),
    "plain document type": "<!DOCTYPE sensor>" + SENSOR.format(z="100"),
}


@pytest.mark.parametrize("text", ATTACKS.values(), ids=ATTACKS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_document_types_and_entities_are_refused(
    text: str, encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "camera.xml"
    file.write_bytes(f'<?xml version="1.0" encoding="{encoding}"?>{text}'.encode(encoding))
    # The parser itself is not to be trusted with it: it must not even be asked.
    monkeypatch.setattr(ElementTree, "fromstring", lambda _text: pytest.fail("the parser was asked"))
    with pytest.raises(InputError, match="declares document types or entities") as refused:
        read_ign_camera(file)
    assert refused.value.file == file


@pytest.mark.parametrize("encoding", ["utf-7", "cp037", "cp500"])
def test_an_encoding_that_hides_a_document_type_is_not_followed(encoding: str, tmp_path: Path) -> None:
    file = tmp_path / "camera.xml"
    file.write_bytes(
        f'<?xml version="1.0" encoding="{encoding}"?>{ATTACKS["billion laughs"]}'.encode(encoding)
    )
    with pytest.raises(InputError, match=r"not well-formed|document types"):
        read_ign_camera(file)


def test_a_declared_encoding_does_not_change_which_characters_are_parsed(tmp_path: Path) -> None:
    # Read as UTF-7, the comment would end before a document type.
    file = tmp_path / "camera.xml"
    file.write_text('<?xml version="1.0" encoding="utf-7"?>' + SENSOR.format(z="100").strip())
    assert read_ign_camera(file).focal_length_mm == pytest.approx(0.5)


def test_a_deep_tree_of_elements_is_only_a_wrong_camera_file(tmp_path: Path) -> None:
    file = tmp_path / "camera.xml"
    file.write_text("<a>" * 200_000 + "</a>" * 200_000)
    with pytest.raises(InputError, match="lacks a number"):
        read_ign_camera(file)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "latin-1"])
def test_a_camera_file_in_any_usual_encoding_is_read(encoding: str, tmp_path: Path) -> None:
    file = tmp_path / "camera.xml"
    text = f'<?xml version="1.0" encoding="{encoding}"?><!-- caméra -->{SENSOR.format(z="100").strip()}'
    file.write_bytes(text.encode(encoding))
    assert read_ign_camera(file).columns == 100
