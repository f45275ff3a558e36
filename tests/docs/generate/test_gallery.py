"""The pictures of the gallery are there, and every one of them is shown."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from docs.generate.gallery import PAGE, commands, pictures


def test_every_picture_of_the_page_is_one_of_the_program_and_none_is_left_over() -> None:
    folder = PAGE.parent / "images" / "gallery"
    assert pictures()
    assert sorted(path.name for path in folder.iterdir()) == sorted(pictures())
    for path in folder.iterdir():
        assert ET.parse(path).getroot().tag == "{http://www.w3.org/2000/svg}svg"


def test_the_page_says_how_its_pictures_were_made() -> None:
    assert [command.split()[0] for command in commands()] == ["simulate", "run", "figures"]
