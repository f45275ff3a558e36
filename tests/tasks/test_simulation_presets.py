"""The presets against the published flights: base, line spacing, GSD, numbers of images."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import pytest

from adjust.simulate.flight_plan import flight_plan
from adjust.simulate.truth import block_truth
from tasks.settings.load_simulation import load_simulation, preset_names
from tasks.settings.published_sweep import published_table
from tasks.simulation.simulation_input import block_specification
from tasks.sweep.scenario import scenarios


@dataclass(frozen=True)
class Published:
    """Figures of a flight: m, cm, images."""

    height: float
    gsd_cm: float
    base: float
    spacing: float
    images: int


FLIGHTS = {
    "uce-low": Published(780.0, 5.07, 265.3, 405.8, 200),
    "uce-high": Published(2340.0, 15.2, 795.8, 1217.0, 28),
    "ucx-8cm": Published(1200.0, 8.6, 153.9, 434.0, 215),
    "ucx-20cm": Published(2875.0, 20.6, 582.0, 892.0, 52),
    "dmc-8cm": Published(870.0, 8.7, 267.0, 481.0, 135),
    "dmc-20cm": Published(2160.0, 21.6, 664.0, 1194.0, 60),
    "rmk-8cm": Published(874.0, 8.0, 526.0, 526.0, 74),
    "ucd": Published(1014.0, 9.0, 270.0, 414.0, 69),
    "ucxp": Published(1500.0, 9.0, 407.2, 623.2, 69),
    "uce-210": Published(2047.5, 5.07, 265.3, 405.8, 200),
    "vaihingen-rmk-high": Published(2186.0, 20.0, 1314.6, 1314.6, 47),
    "vaihingen-rmk-low": Published(874.0, 8.0, 526.0, 526.0, 74),
    "dmc-burn-in": Published(2000.0, 20.0, 614.4, 1105.9, 40),
    "dmc2-140": Published(1150.0, 9.0, 403.0, 435.0, 69),
    "dmc2-230": Published(1150.0, 7.0, 396.0, 436.0, 2448),
    "dmc2-250": Published(1800.0, 9.0, 528.0, 620.0, 69),
}


#: The same flights with errors of the camera and their scenarios.
VAIHINGEN = {
    "vaihingen-ucx-high": "ucx-20cm",
    "vaihingen-ucx-low": "ucx-8cm",
    "vaihingen-dmc-high": "dmc-20cm",
    "vaihingen-dmc-low": "dmc-8cm",
}

#: Test blocks of the DMC II: images that see a control point and a check point on average, as published.
DMC2 = {"140": (8.4, 10.6), "230": (6.2, 6.2), "250": (9.6, 12.7)}

#: Flights with several heads.
RIGS = ("dmc-heads", "dmc-protocol", "penta")
TEST_BLOCKS = tuple(f"dmc2-{camera}-test" for camera in DMC2)


def test_every_preset_but_the_combined_ones_is_in_the_table() -> None:
    assert set(preset_names()) == {
        *FLIGHTS,
        *VAIHINGEN,
        "uce-calibration",
        "uce-testfield",
        *RIGS,
        *TEST_BLOCKS,
    }


@pytest.mark.parametrize(("name", "flight"), list(VAIHINGEN.items()))
def test_the_vaihingen_twins_are_the_flights_with_scenarios_of_the_print(name: str, flight: str) -> None:
    twin, plain = load_simulation(name), load_simulation(flight)
    assert twin.camera == plain.camera
    unnamed = [lines.model_copy(update={"flight": "1"}) for lines in twin.flight]
    assert unnamed == list(plain.flight)
    assert (twin.points, twin.control, twin.terrain) == (plain.points, plain.control, plain.terrain)
    assert twin.sweep is not None
    assert twin.sweep.compare_with is not None
    own = {(one.block, one.control, one.variant) for one in scenarios(twin.sweep)}
    assert own <= set(published_table(twin.sweep.compare_with).figures)
    assert len(own) == 3


@pytest.mark.parametrize("name", ["vaihingen-rmk-high", "vaihingen-rmk-low"])
def test_the_film_blocks_have_fiducial_marks_and_the_scenarios_of_the_print(name: str) -> None:
    twin = load_simulation(name)
    assert twin.film is not None
    assert twin.film.shrinkage_ppm == 100.0
    assert twin.sweep is not None
    own = {(one.block, one.control, one.variant) for one in scenarios(twin.sweep)}
    assert own <= set(published_table("vaihingen-rmk-2008").figures)
    assert len(own) == 3


@pytest.mark.parametrize("camera", ["ucx", "dmc", "rmk"])
def test_both_flights_of_a_vaihingen_twin_have_the_same_camera_with_the_same_errors(camera: str) -> None:
    high, low = (
        block_truth(block_specification(load_simulation(f"vaihingen-{camera}-{height}")))
        for height in ("high", "low")
    )
    places = np.random.default_rng(2).uniform(-0.03, 0.03, (200, 2))
    np.testing.assert_array_equal(*(truth.image_errors[0].error(places) for truth in (high, low)))
    assert np.abs(high.image_errors[0].error(places)).max() > 1e-7


@pytest.mark.parametrize("camera", list(DMC2))
def test_the_test_blocks_of_the_dmc_ii_have_their_coverage_image_errors_and_scenarios(camera: str) -> None:
    simulation = load_simulation(f"dmc2-{camera}-test")
    specification = block_specification(simulation)
    truth = block_truth(specification)
    images = np.bincount(truth.point, minlength=len(truth.points))[truth.surveyed]
    control, check = DMC2[camera]
    assert images[~truth.is_check].mean() == pytest.approx(control, rel=0.1)
    assert images[truth.is_check].mean() == pytest.approx(check, rel=0.2)
    half = np.array(specification.cameras[0].half_format)
    grid = np.stack(np.meshgrid(*[np.linspace(-0.999, 0.999, 41)] * 2), -1).reshape(-1, 2) * half
    assert np.hypot(*truth.image_errors[0].error(grid).T).mean() == pytest.approx(0.32e-6, rel=0.01)
    assert simulation.sweep is not None
    own = {(one.block, one.control, one.variant) for one in scenarios(simulation.sweep)}
    printed = {one for one in published_table("dmc2-2012").figures if one[0].startswith(camera)}
    assert printed <= own


@pytest.mark.parametrize("name", list(FLIGHTS))
def test_a_preset_has_the_published_geometry(name: str) -> None:
    published, specification = FLIGHTS[name], block_specification(load_simulation(name))
    camera, main = specification.cameras[0], specification.flight[0]
    assert main.height == published.height
    gsd = main.height * camera.pixel_size / camera.focal_length
    # Half a unit of the last digit that is printed.
    assert 100.0 * gsd == pytest.approx(published.gsd_cm, abs=0.06)
    assert main.base == pytest.approx(published.base, abs=0.5)
    assert main.spacing == pytest.approx(published.spacing, abs=0.7)
    assert len(flight_plan(specification.flight).images) == published.images


def test_the_low_flight_has_seven_lines_east_and_west_and_nine_north_and_south() -> None:
    east, north = block_specification(load_simulation("uce-low")).flight
    assert east.exposures == (15,) * 7
    assert sorted(north.exposures) == [10] * 4 + [11] * 5
    assert np.isclose(east.heading - north.heading, np.pi / 2)


def test_the_calibration_flight_has_both_heights_and_every_line_forward_and_reverse() -> None:
    plan = flight_plan(block_specification(load_simulation("uce-calibration")).flight)
    assert len(plan.images) == 2 * (200 + 28)
    assert set(plan.height) == {780.0, 2340.0}
    headings = {strip: np.degrees(plan.heading[plan.strip == k][0]) for k, strip in enumerate(plan.strips)}
    for strip, heading in headings.items():
        if strip.endswith("f"):
            assert (headings[f"{strip[:-1]}r"] - heading) % 360.0 == pytest.approx(180.0)
    # One GNSS shift for both heights is what separates it from the focal length.
    assert plan.flights == ("1",)


def test_the_test_field_has_its_points_image_points_and_control() -> None:
    truth = block_truth(block_specification(load_simulation("uce-low")))
    assert len(truth.points) == pytest.approx(5300, rel=0.01)
    assert 25_000 < len(truth.xy) < 28_000
    assert len(truth.surveyed) == 84
    # Crossing lines with 60 % both ways: up to 18 images see a point when all are detected.
    assert 12 <= np.bincount(truth.point).max() <= 18


def test_the_test_field_of_both_heights_has_the_published_size_and_scenarios() -> None:
    simulation = load_simulation("uce-testfield")
    truth = block_truth(block_specification(simulation))
    assert len(truth.plan.images) == 228
    assert np.bincount(truth.plan.flight).tolist() == [200, 28]
    assert len(truth.points) == pytest.approx(5300, rel=0.01)
    assert 25_000 < len(truth.xy) < 34_000
    assert len(truth.surveyed) == 84
    # Every surveyed point lies in the low flight, so that all blocks have 84.
    low = truth.plan.flight[truth.image] == truth.plan.flights.index("low")
    seen = np.bincount(truth.point[low], minlength=len(truth.points))[truth.surveyed]
    assert seen.min() >= 2
    assert simulation.sweep is not None
    assert published_table("uce-2012").figures.keys() <= {
        (one.block, one.control, one.variant) for one in scenarios(simulation.sweep)
    }


def test_the_burn_in_flight_has_its_control_and_nearly_its_degrees_of_freedom() -> None:
    truth = block_truth(block_specification(load_simulation("dmc-burn-in")))
    assert len(truth.surveyed) == 14
    exposures = 6 * len(truth.plan.images)
    freedom = 2 * len(truth.xy) + 3 * 14 + exposures - (exposures + 3 * len(truth.points))
    assert freedom == pytest.approx(8404, rel=0.02)


def test_vaihingen_has_nine_control_and_ninety_nine_check_points() -> None:
    truth = block_truth(block_specification(load_simulation("dmc-20cm")))
    assert (~truth.is_check).sum() == 9
    assert truth.is_check.sum() == 99


@pytest.mark.slow
def test_the_operational_block_has_its_size_and_is_simulated_in_seconds() -> None:
    started = time.process_time()
    truth = block_truth(block_specification(load_simulation("dmc2-230")))
    assert time.process_time() - started < 15.0
    assert len(truth.points) == pytest.approx(188_000, rel=0.01)
    assert len(truth.xy) == pytest.approx(545_000, rel=0.01)
    assert len(truth.surveyed) == 60
