"""The examination of images as a Prefect flow: same bytes, and states that say what happened."""

from __future__ import annotations

from pathlib import Path

import pytest

from flows.runs.examination_request import ExaminationRequest
from flows.runs.project_run import carry_out
from flows.stories.image_quality import image_quality as story
from tests.flows.serving.test_registered import digests, latest_run
from tests.flows.test_image_quality import write_image

pytestmark = [pytest.mark.prefect, pytest.mark.usefixtures("prefect_server")]


def reported(image: Path, out: Path, *overrides: str) -> tuple[str, str, str]:
    """Type, name and message of the state that the server has of an examination."""
    from flows.serving.registered import run_and_report

    run_and_report(ExaminationRequest(image, out, overrides), "image_quality", lambda: story)
    state = latest_run("image-quality").state
    assert state is not None
    return state.type.value, str(state.name), str(state.message)


def test_under_prefect_and_in_process_give_the_same_bytes(tmp_path: Path) -> None:
    image = write_image(tmp_path / "one.tif", 3, size=320)
    assert reported(image, tmp_path / "flow")[:2] == ("COMPLETED", "Completed")
    outcome = carry_out(story, ExaminationRequest(image))
    assert outcome.directory == tmp_path / "image-quality"
    assert digests(tmp_path / "flow") == digests(tmp_path / "image-quality")


@pytest.mark.parametrize(
    ("override", "name", "word"),
    [
        ("image_quality.factor_max=1.1", "GateFailed", "largest_factor"),
        ("image_quality.bands=[7]", "InputError", "Band 7 cannot be examined"),
    ],
)
def test_what_went_wrong_is_the_name_of_the_state(
    tmp_path: Path, override: str, name: str, word: str
) -> None:
    image = write_image(tmp_path / "one.tif", 3, size=320)
    kind, found, message = reported(image, tmp_path / "out", override)
    assert (kind, found) == ("FAILED", name)
    assert word in message
