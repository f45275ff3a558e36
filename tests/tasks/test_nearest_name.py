from __future__ import annotations

from tasks.nearest_name import did_you_mean, nearest


def test_the_nearest_name_is_found_whatever_the_case():
    assert nearest("UCE-S07", ["uce-s08", "uce-s07"]) == "uce-s07"


def test_nothing_alike_is_nothing():
    assert nearest("xyz", ["focal_length", "boresight"]) is None
    assert did_you_mean("xyz", ["a", "b"]) == "Known names: 'a', 'b'."


def test_long_lists_are_cut_short():
    text = did_you_mean("?", [f"name{i}" for i in range(40)])
    assert text.count("'name") == 12
    assert text.endswith("….")


def test_no_names_at_all_are_said():
    assert did_you_mean("a", []) == "There are none."


def test_names_that_look_the_same_are_told_apart_by_their_characters():
    text = did_you_mean("Fl\u00fcg 1", ["Flu\u0308g 1", "Flug 2"])
    assert text.startswith("Did you mean 'Flu\u0308g 1'? They look alike")
    assert r"'Fl\xfcg 1' and 'Flu\u0308g 1'" in text
    assert r"'a\xa01'" in did_you_mean("a 1", ["a\xa01"])
    assert "alike" not in did_you_mean("a 1", ["a 2"])
