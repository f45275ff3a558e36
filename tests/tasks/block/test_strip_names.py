from __future__ import annotations

from tasks.block.strip_names import strip_names


def test_a_name_in_one_flight_stays_and_one_in_several_gets_its_flight() -> None:
    flight = ["a", "a", "b", "b", "b"]
    assert strip_names(flight, ["1", "2", "1", "3", "3"]) == ["1 of flight a", "2", "1 of flight b", "3", "3"]


def test_without_flights_or_strips_nothing_is_added() -> None:
    assert strip_names(["", ""], ["1", "2"]) == ["1", "2"]
    assert strip_names(["", ""], ["", ""]) == ["", ""]
    assert strip_names(["a", "b"], ["", ""]) == ["", ""]
    assert strip_names([], []) == []
