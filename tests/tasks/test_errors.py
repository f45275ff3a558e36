"""Errors reach the user as they were raised, from wherever they were raised."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from tasks.errors import AerocalError, InputError, NotComputableError
from tasks.files.installation import InstallationError


def test_a_long_path_leaves_room_for_what_is_wrong() -> None:
    error = InputError("It is wrong.", "Mend it.", Path("x/" * 3_000), 3)
    assert str(error).endswith("…:3: It is wrong. Mend it.")


@pytest.mark.parametrize(
    "error",
    [
        InputError("The text is wrong.", "Write another.", Path("points.csv"), 3, "image '7'"),
        InputError(what="The file changed.", remedy="Wait.", file=Path("points.csv")),
        NotComputableError(what="The datum is open."),
        InstallationError(what="The disk is full.", remedy="Free some space."),
    ],
)
def test_an_error_comes_back_from_another_process_with_all_it_says(error: AerocalError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert vars(again) == vars(error)
    assert str(again) == str(error)
