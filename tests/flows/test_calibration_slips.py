"""No wrong calibration is accepted: slips in simulated deliveries, and deliveries without a slip."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.flows.calibration_slips import (
    GEOMETRIES,
    LEVER_ARM,
    PAIRS,
    SLIPS,
    STATED,
    Fate,
    Slip,
    added,
    fate,
    flown,
    in_flight,
    with_slip,
)

#: An error of a certified parameter beyond this, in its σ, must not be accepted.
WRONG = 3.0
#: Seed of the deliveries, and number of flights without a slip; docs/status.md has more of both.
SEED = int(os.environ.get("AEROCAL_SEED", "3"))
CLEAN = int(os.environ.get("AEROCAL_FLIGHTS", "12"))

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=GEOMETRIES)
def delivery(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("delivery") / "flight"
    return flown(folder, SEED, geometry=str(request.param))


def test_the_delivery_without_a_slip_is_accepted(delivery: Path, tmp_path: Path) -> None:
    found = fate(with_slip(delivery, Slip("none"), tmp_path / "flight"))
    assert (found.verdict, found.reasons, found.first) == ("accepted", (), "")
    assert found.worst < WRONG


@pytest.mark.parametrize("slip", [*SLIPS, *PAIRS], ids=lambda slip: slip.name)
def test_a_slip_is_refused_or_stated_as_what_this_flight_cannot_notice(
    delivery: Path, slip: Slip, tmp_path: Path
) -> None:
    project = with_slip(delivery, slip, tmp_path / "flight")
    found = fate(project, slip.stated)
    one_or_two = slip.of or (slip,)
    if found.verdict in ("input_error", "not_computable"):
        assert any(one.words and one.words in found.reasons[0] for one in one_or_two), found
    elif found.verdict == "refused":
        # A σ beyond its limit refuses, too, whatever else was not noticed.
        by_its_sigmas = all(" is weak: " in reason for reason in found.reasons)
        assert by_its_sigmas or any(_is_named(one, found) for one in one_or_two), found
    elif found.worst > WRONG:
        assert _moved_by_unnoticed(project, one_or_two) > found.worst, found


def _is_named(slip: Slip, found: Fate) -> bool:
    """As the first cause, as one that would look nearly the same, or in a reason of another kind."""
    alike = slip.cause.partition(" ")[0].replace("_", " ").replace("gnss", "GNSS")
    by_model = bool(slip.cause) and (found.first.startswith(slip.cause) or alike in found.alike)
    return by_model or (bool(slip.words) and any(slip.words in reason for reason in found.reasons))


def _moved_by_unnoticed(project: Path, slips: tuple[Slip, ...]) -> float:
    """How far, in σ, the certificate's table says that unnoticed errors of these kinds move a parameter."""
    table = pd.read_parquet(project / "results" / "model_alternatives.parquet")
    moved = (
        table["moved_by_detectable"].where(table["t"].notna(), np.inf).where(table["scope"] != "strip", 0.0)
    )
    kinds = [slip.unnoticed or slip.cause.partition(" ")[0] for slip in slips]
    return float(sum(moved[table["quantity"].str.startswith(kind)].max() for kind in kinds if kind))


def test_heights_that_are_called_flights_are_told_apart_or_declared_as_one(tmp_path: Path) -> None:
    names = [f"flight.{number}.flight={'low' if number < 2 else 'high'}" for number in range(4)]
    project = flown(tmp_path / "delivery", SEED, *names)
    apart = fate(with_slip(project, Slip("none"), tmp_path / "apart"))
    assert apart.verdict == "refused"
    assert "'high' and 'low' were each flown at one height" in apart.reasons[0]
    declared = "inputs.exposures.flights={low={part_of='1'}, high={part_of='1'}}"
    together = fate(with_slip(project, Slip("none"), tmp_path / "together"), (declared,))
    assert together.verdict == "accepted"
    assert together.worst < WRONG


def test_a_remounted_camera_with_a_name_of_its_own_has_its_own_calibration(tmp_path: Path) -> None:
    days = ("flight.1.flight=day 2", "flight.3.flight=day 2")
    turned = Slip("remounted", exposures=added(in_flight("day 2"), pitch=0.02))
    delivered = with_slip(flown(tmp_path / "delivery", SEED, *days), turned, tmp_path / "one")
    one = fate(delivered)
    assert one.verdict == "refused"
    assert one.first == "boresight flight 1"
    assert any("not flown with one mounting" in restriction for restriction in one.restrictions)
    project = with_slip(tmp_path / "delivery", turned, tmp_path / "two") / "project.toml"
    before, _, rest = project.read_text().partition("[cameras.UCE-80]")
    camera, _, after = rest.partition("\n[")
    project.write_text(f"{before}[cameras.UCE-80]{camera}\n[cameras.again]{camera}\n[{after}")
    stated = (
        "inputs.exposures.flights={'day 2'={camera='again'}}",
        f"cameras.again.lever_arm_m={list(LEVER_ARM)}",
    )
    two = fate(project.parent, stated)
    assert two.verdict == "accepted"
    assert two.worst < WRONG


@pytest.mark.timeout(7200)
def test_flights_without_a_slip_are_accepted_and_their_errors_are_as_large_as_stated(tmp_path: Path) -> None:
    """Random lever arms up to 2 m, misalignments up to 2°, mounts, angle systems; all stated rightly."""
    random = np.random.default_rng(2026)
    fates = []
    for number in range(CLEAN):
        arm = [float(f"{value:.2f}") for value in random.uniform(-2.0, 2.0, 3)]
        mount = int(random.choice([0, 90, 180, 270]))
        angles = str(random.choice(["heading-pitch-roll", "omega-phi-kappa"]))
        boresight = [float(f"{value:.4f}") for value in random.uniform(-2.0, 2.0, 3)]
        project = flown(
            tmp_path / f"flight{number}",
            1000 + number,
            f"truth.lever_arm_m={arm}",
            f"truth.boresight_deg={boresight}",
            f"camera.mount_deg={mount}",
            f'project.angles="{angles}"',
        )
        fates.append(fate(project, (f"cameras.UCE-80.lever_arm_m={arm}", *STATED[1:])))
    accepted = sum(item.verdict == "accepted" for item in fates)
    errors = np.concatenate([item.errors for item in fates])
    rms = float(np.sqrt(np.mean(errors**2)))
    print(f"{accepted} of {CLEAN} accepted; errors/σ {rms:.3f} ({len(errors)} errors)")
    for item in fates:
        if item.verdict != "accepted":
            print(item.verdict, item.first, item.reasons)
    assert accepted >= 0.97 * CLEAN - 1
    # 99.9 % of the RMS of so many errors, nine of each flight, correlated among themselves.
    assert abs(rms - 1.0) < 0.05 + 3.3 / np.sqrt(2.0 * len(errors) / 3.0)
