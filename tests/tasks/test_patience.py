"""What is tried again, after which pauses, and when it is given up."""

from __future__ import annotations

import pytest

from tasks.patience import Patience


def test_pauses_double_up_to_their_limit_and_the_last_error_passes() -> None:
    time_s, pauses, said = [0.0], list[float](), list[float]()

    def pause(seconds: float) -> None:
        pauses.append(seconds)
        time_s[0] += seconds

    def act() -> None:
        raise OSError("away")

    with pytest.raises(OSError, match="away"):
        Patience(1.0, 4.0, 12.0).tried(
            act,
            lambda error: isinstance(error, OSError),
            lambda _error, _pause_s, waited_s: said.append(waited_s),
            pause=pause,
            now=lambda: time_s[0],
        )
    assert pauses == [1.0, 2.0, 4.0, 4.0, 1.0]
    assert said == [0.0, 1.0, 3.0, 7.0, 11.0]


def test_what_does_not_pass_is_not_tried_again() -> None:
    calls: list[int] = []

    def act() -> None:
        calls.append(1)
        raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"):
        Patience(1.0, 4.0, 12.0).tried(act, lambda error: isinstance(error, OSError))
    assert calls == [1]


def test_an_act_that_succeeds_later_gives_its_result() -> None:
    outcomes = [OSError("away"), OSError("away"), None]

    def act() -> str:
        failed = outcomes.pop(0)
        if failed is not None:
            raise failed
        return "done"

    patience = Patience(1.0, 4.0, 12.0)
    assert patience.tried(act, lambda _error: True, pause=lambda _s: None) == "done"
