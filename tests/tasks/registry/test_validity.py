"""Days of a validity, counted one by one."""

from __future__ import annotations

from datetime import date, timedelta
from itertools import product

from tasks.registry.history import Validity

DAYS = [date(2024, 2, 27) + timedelta(days=k) for k in range(5)]
#: Every validity that begins within some days, and ends there or never.
ALL = [Validity(start, end) for start, end in product(DAYS, (*DAYS, None)) if end is None or start <= end]
#: The same with days behind, which only one without an end has.
CALENDAR = [*DAYS, DAYS[-1] + timedelta(days=1), DAYS[-1] + timedelta(days=2)]


def days(validity: Validity | None) -> set[date]:
    return set() if validity is None else {day for day in CALENDAR if validity.contains(day)}


def test_the_first_and_the_last_day_belong_to_it() -> None:
    assert days(Validity(DAYS[1], DAYS[3])) == set(DAYS[1:4])
    assert days(Validity(DAYS[1])) == set(CALENDAR[1:])


def test_two_overlap_if_they_have_a_day_in_common() -> None:
    for one, other in product(ALL, ALL):
        assert one.overlaps(other) is bool(days(one) & days(other))


def test_before_a_day_what_is_left_are_the_days_before_it() -> None:
    for one, day in product(ALL, CALENDAR):
        assert days(one.before(day)) == {own for own in days(one) if own < day}
