"""A further runner has the same registry and results as its server, or is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from flows.serving.served_places import ServedPlaces, places_in, require_same, schema_of
from tasks.errors import InputError

SERVER = ServedPlaces((Path("/data"),), registry=True, results="s3://bucket/results")


def test_what_a_deployment_tells_is_what_was_meant() -> None:
    assert places_in({"properties": {}} | schema_of(SERVER)) == SERVER
    for older in (None, {}, {"of_server": 3}, {"of_server": {"folders": 3}}):
        assert places_in(older) is None  # type: ignore[arg-type]


def test_folders_may_differ() -> None:
    require_same(replace(SERVER, folders=()), SERVER)


@pytest.mark.parametrize(
    ("own", "said"),
    [
        (
            replace(SERVER, registry=False),
            "The server has a registry of calibrations, and the runner has none.",
        ),
        (replace(SERVER, results=None), "at s3://bucket/results, and this runner at no address."),
        (replace(SERVER, results="s3://bucket/other"), "and this runner at s3://bucket/other."),
    ],
)
def test_another_registry_or_other_results_are_refused(own: ServedPlaces, said: str) -> None:
    with pytest.raises(InputError) as refused:
        require_same(own, SERVER)
    assert said in str(refused.value)
    with pytest.raises(InputError, match="Start both with the same --"):
        require_same(SERVER, own)
