"""Slips in a real delivery: each is refused with one message that says what is wrong and what to do.

What can be seen in a single file is tested with the import; here the files contradict each other.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from tests.flows.adjustment_alone import adjustment_alone

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "ign_ultracam_eagle" / "project.toml"
DATA = "ign_ultracam_eagle_m3"


@pytest.fixture(scope="module")
def as_it_is(test_data: Path, tmp_path_factory: pytest.TempPathFactory) -> RunOutcome:
    """The example without any slip."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AEROCAL_TEST_DATA", str(test_data))
        return carry_out(adjustment_alone, RunRequest(EXAMPLE, tmp_path_factory.mktemp("as it is")))


@pytest.fixture
def out(test_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, as_it_is: RunOutcome) -> Path:
    """A folder for the results of the example, with what a slip leaves as it is."""
    monkeypatch.setenv("AEROCAL_TEST_DATA", str(test_data))
    shutil.copytree(as_it_is.directory / ".store", tmp_path / "out" / ".store")
    return tmp_path / "out"


@pytest.fixture
def refusal(out: Path) -> Callable[..., str]:
    """The message with which the example is refused; nothing but summary.json is written."""

    def run(*overrides: str) -> str:
        outcome = carry_out(adjustment_alone, RunRequest(EXAMPLE, out, overrides))
        assert outcome.error is not None
        assert outcome.summary.status == "input_error"
        assert outcome.summary.problems == (outcome.error,)
        assert [p.name for p in out.iterdir() if not p.name.startswith(".")] == ["summary.json"]
        return outcome.error

    return run


@pytest.fixture
def trajectory(test_data: Path) -> list[str]:
    return (test_data / DATA / "trajectograhie.opk").read_text().splitlines()


def rewritten(lines: list[str], change: Callable[[list[str]], list[str]]) -> str:
    """The trajectory with the columns of every row changed."""
    return "\n".join([lines[0], *(" ".join(change(line.split())) for line in lines[1:] if line.strip())])


def test_degrees_declared_as_gon(refusal) -> None:
    message = refusal('inputs.exposures.angles.unit="gon"')
    readme = (EXAMPLE.parents[2] / "README.md").read_text(encoding="utf-8").splitlines()
    shown = " ".join(line.removeprefix("> ") for line in readme if line.startswith("> "))
    assert re.sub(r"\(ten times .+?\)", "(…)", message) == shown


def test_gon_declared_as_degrees(refusal, trajectory: list[str], tmp_path: Path) -> None:
    def to_gon(row: list[str]) -> list[str]:
        return [*row[:4], *(repr(float(angle) / 0.9) for angle in row[4:7]), row[7]]

    (tmp_path / "gon.opk").write_text(rewritten(trajectory, to_gon))
    message = refusal(f'inputs.exposures.file="{tmp_path / "gon.opk"}"')
    assert 'Declare angles.unit = "gon"' in message


def test_grid_angles_declared_as_true_north(refusal) -> None:
    """The meridian convergence is nearly two degrees here, hundreds of pixels."""
    message = refusal('inputs.exposures.angles.reference="true-north"')
    assert 'Declare angles.reference = "grid"' in message


def test_kappa_of_one_image_turned_by_half_a_turn(refusal, trajectory: list[str], tmp_path: Path) -> None:
    def turned(row: list[str]) -> list[str]:
        if row[0] == "21FD244720x00016_00810":
            row[6] = repr(float(row[6]) + 180.0)
        return row

    (tmp_path / "turned.opk").write_text(rewritten(trajectory, turned))
    message = refusal(f'inputs.exposures.file="{tmp_path / "turned.opk"}"')
    assert message.startswith("image 21FD244720x00016_00810: ")
    assert "κ looks rotated by 180°" in message


def test_all_images_turned_by_half_a_turn(refusal, trajectory: list[str], tmp_path: Path) -> None:
    def turned(row: list[str]) -> list[str]:
        return [*row[:6], repr(float(row[6]) + 180.0), row[7]]

    (tmp_path / "turned.opk").write_text(rewritten(trajectory, turned))
    message = refusal(f'inputs.exposures.file="{tmp_path / "turned.opk"}"')
    assert "rotated by 180°" in message


def test_one_exposure_with_a_wrong_position(refusal, trajectory: list[str], tmp_path: Path) -> None:
    def moved(row: list[str]) -> list[str]:
        if row[0] == "21FD244720x00016_00810":
            row[2] = repr(float(row[2]) + 400.0)
        return row

    (tmp_path / "moved.opk").write_text(rewritten(trajectory, moved))
    message = refusal(f'inputs.exposures.file="{tmp_path / "moved.opk"}"')
    assert message.startswith("image 21FD244720x00016_00810: ")


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        (
            "724046 13 522565.580 6459960.990 252.830",
            r"control point 724046: The 5 rays intersect 1,00\d\.\d m",
        ),
        ("724046 13 6459960.990 521565.580 252.830", "swapped"),
    ],
    ids=["one kilometre off", "x and y swapped"],
)
def test_wrong_control(refusal, tmp_path: Path, row: str, expected: str) -> None:
    (tmp_path / "control.app").write_text(row + "\n")
    assert re.search(expected, refusal(f'inputs.control.file="{tmp_path / "control.app"}"'))


def test_control_above_the_geoid_declared_as_ellipsoidal(refusal, tmp_path: Path) -> None:
    (tmp_path / "control.app").write_text("724046 13 521565.580 6459960.990 201.8\n")
    message = refusal(f'inputs.control.file="{tmp_path / "control.app"}"', "checks.control_distance_m=20")
    assert "heights" in message
    assert "geoid" in message


def test_missing_geoid_grid(refusal) -> None:
    message = refusal('inputs.control.heights={geoid="nowhere.tif"}')
    assert "nowhere.tif" in message


def test_a_wrong_mounting_is_suspected_from_the_track(out: Path) -> None:
    """Collinearity does not see it, so it is a named suspicion, not an error."""
    overrides = ("cameras.UCE-M3-f120-s07.mount_deg=180",)
    outcome = carry_out(adjustment_alone, RunRequest(EXAMPLE, out, overrides))
    assert outcome.error is None
    assert any("mount_deg" in text for text in outcome.summary.problems)


@pytest.mark.parametrize(
    ("example", "heights"),
    [
        # The real thing: altitudes above the geoid, declared as ellipsoidal heights.
        ("ign_borea", None),
        # Ellipsoidal heights less the undulation of 48.6 m, with a single control point.
        ("ign_ultracam_eagle", 48.6),
    ],
)
def test_orthometric_heights_of_the_exposures(
    test_data: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    trajectory: list[str],
    example: str,
    heights: float | None,
) -> None:
    monkeypatch.setenv("AEROCAL_TEST_DATA", str(test_data))
    override = 'inputs.exposures.heights="ellipsoidal"'
    if heights is not None:
        text = rewritten(trajectory, lambda row: [*row[:3], repr(float(row[3]) - heights), *row[4:]])
        (tmp_path / "orthometric.opk").write_text(text)
        override = f'inputs.exposures.file="{tmp_path / "orthometric.opk"}"'
    project = EXAMPLE.parents[1] / example / "project.toml"
    outcome = carry_out(adjustment_alone, RunRequest(project, tmp_path / "out", (override,)))
    said = [
        text for text in outcome.summary.problems if "different height systems (geoid undulation?)" in text
    ]
    assert len(said) == 1
    metres = re.search(r"out (\d+\.\d) m lower than given", said[0])
    assert metres is not None
    assert float(metres[1]) == pytest.approx(49.0, abs=3.0)


@pytest.mark.parametrize(
    ("lever_arm", "words"),
    [
        ((0.61, 0.34), None),
        ((-0.61, -0.34), "along forward and right"),
        pytest.param((0.61, -0.34), "along right", marks=pytest.mark.slow),
    ],
)
def test_wrong_signs_of_the_lever_arm(out: Path, lever_arm: tuple[float, float], words: str | None) -> None:
    """IGN's own solution has (0.61, 0.34) m forward, right; what 20 images say of it is 0.1 to 0.2 m off."""
    overrides = (
        f"cameras.UCE-M3-f120-s07.lever_arm_m=[{lever_arm[0]}, {lever_arm[1]}, 0.0]",
        # What the reduction left over is the arm of the point that was delivered.
        "inputs.exposures.position=antenna",
        'adjustment.free=["boresight"]',
    )
    outcome = carry_out(adjustment_alone, RunRequest(EXAMPLE, out, overrides))
    assert outcome.error is None
    said = [
        text for text in outcome.summary.problems if "lever arm of camera UCE-M3-f120-s07 looks as" in text
    ]
    if words is None:
        assert said == []
    else:
        assert f"had the wrong sign {words}: (" in said[0]


def test_the_example_as_it_is_raises_no_suspicion(as_it_is: RunOutcome) -> None:
    assert_no_suspicion(as_it_is)


def test_the_other_example_as_it_is_raises_none_either(
    test_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AEROCAL_TEST_DATA", str(test_data))
    project = EXAMPLE.parents[1] / "ign_borea" / "project.toml"
    assert_no_suspicion(carry_out(adjustment_alone, RunRequest(project, tmp_path / "out")))


def assert_no_suspicion(outcome: RunOutcome) -> None:
    assert outcome.error is None
    words = ("height systems", "looks as if", "look like", "look rotated", "appear", "mount_deg")
    assert [text for text in outcome.summary.problems if any(word in text for word in words)] == []
