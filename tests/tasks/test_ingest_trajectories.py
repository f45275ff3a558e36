"""Exposures of a simulated trajectory, 200 Hz and 60 m/s, against its own path; and all that can be wrong."""

from __future__ import annotations

import numpy as np
import pytest

from adjust.simulate.block import simulate_block
from adjust.simulate.flown_path import flown_path
from tasks.coordinates.local_frame import local_from_map
from tasks.deliveries.exposures import exposure_columns
from tasks.errors import InputError
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tasks.simulation.simulation_input import block_specification, simulated_frame, simulated_map_frame
from tests.tasks.trajectory_flight import ARM, OFFSET, SPEC, Flight, errors, solution_of, stacked


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trajectory")
    (folder / "spec.toml").write_text(SPEC)
    simulation = load_simulation(str(folder / "spec.toml"))
    simulate_project(simulation, folder / "project")
    block = simulate_block(block_specification(simulation))
    frames = simulated_map_frame(simulation.project), simulated_frame(simulation.project)
    return Flight(folder / "project", block, *frames)


def test_exposures_are_those_of_the_path_at_the_moments_of_the_events(flight):
    columns, problems = flight.imported()
    metres, degrees, rates = errors(flight, columns)
    assert metres.max() < 1e-5  # asked for: 1e-3
    assert degrees.max() < 1e-7  # asked for: 2e-4
    assert rates.max() < 1e-6
    assert len(metres) == 8
    # The same path without the offset is 18 cm off: the moments are the events', not the exposures'.
    np.testing.assert_allclose(errors(flight, columns, 0.0)[0], 60.0 * OFFSET, rtol=0.05)
    assert "8 events interpolated between samples 0.005 s apart" in problems[0]


def test_moments_in_a_turn_are_as_good(flight):
    """The bank changes fastest there; the moments lie anywhere between samples."""
    path = flown_path(flight.block.truth.plan, flight.block.truth.trajectory, 0)
    time = flight.block.truth.trajectory.time
    middle = np.sort(time)[3] + 5.0 + np.linspace(0.0, 170.0, 57)
    rows = "".join(f"T{k},{moment!r},UCE-80,T\n" for k, moment in enumerate(middle.tolist()))
    (flight.folder / "turn.csv").write_text("image,time,camera,strip\n" + rows)
    columns, _ = flight.imported(events={"file": "turn.csv"})
    place = local_from_map(flight.map_frame, flight.frame, stacked(columns, "x_m", "y_m", "z_m"))
    true = path.position(middle) + path.local_from_body(middle) @ np.array(ARM)
    assert np.linalg.norm(place - true, axis=1).max() < 1e-5
    assert np.ptp(stacked(columns, "roll_deg")) > 15.0


def test_accuracies_are_interpolated_between_their_records(flight):
    table = np.frombuffer((flight.folder / "smrmsg.out").read_bytes(), "<f8").reshape(-1, 10).copy()
    table[:, 1] = 0.01 + 1e-4 * (table[:, 0] - table[0, 0])
    table[:, 9] = 0.3
    columns, _ = flight.imported(trajectory={"accuracy": flight.write("rising.out", table)})
    time = columns["time_s"]
    np.testing.assert_allclose(columns["sigma_heading_deg"], 0.005, rtol=1e-9)
    # North of the true east-north axes, turned into the grid: the small convergence mixes the two a little.
    np.testing.assert_allclose(columns["sigma_y_m"], 0.01 + 1e-4 * (time - table[0, 0]), rtol=2e-3)
    error = flight.refused(trajectory={"accuracy": flight.write("short.out", table[:30])})
    assert "do not contain the time of this event" in error.what


def test_an_event_outside_is_refused_or_left_out_but_never_extrapolated(flight):
    table = flight.samples()
    time = np.sort(flight.block.truth.trajectory.time)
    late = table[table[:, 0] < time[-1]]
    error = flight.refused(file=flight.write("late.sbet", late))
    assert error.file.name == "events.csv"
    assert error.line == 9
    assert "s after the last sample" in error.what
    columns, problems = flight.imported(file="late.sbet", events={"outside": "leave-out"})
    assert np.isnan(columns["x_m"]).tolist() == [False] * 7 + [True]
    assert np.isnan(columns["heading_deg"]).tolist() == [False] * 7 + [True]
    assert any("1 events are excluded, as declared" in problem for problem in problems)


def test_an_event_in_a_gap_is_refused_unless_so_long_an_interval_is_allowed(flight):
    table, moment = flight.samples(), float(np.sort(flight.block.truth.trajectory.time)[2])
    torn = table[np.abs(table[:, 0] - moment) > 0.1]
    error = flight.refused(file=flight.write("torn.sbet", torn))
    assert (error.line, "in a gap of 0.2" in error.what) == (4, True)
    columns, _ = flight.imported(file="torn.sbet", trajectory={"longest_gap_s": 0.5})
    assert errors(flight, columns)[0].max() < 0.01


@pytest.mark.parametrize(
    ("trajectory", "events", "shift"),
    [
        ({"time": "gps-week"}, {"time": "utc-week"}, -18.0),
        ({"time": "utc-week"}, {"time": "gps-week"}, 18.0),
        ({"time": "gps-week"}, {"time": "gps-day"}, 0.0),
    ],
)
def test_events_on_another_clock_are_the_same_moments(flight, trajectory, events, shift):
    lines = (flight.folder / "events.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    changed = [",".join([row[0], repr(float(row[1]) + shift), *row[2:]]) for row in rows]
    (flight.folder / "other.csv").write_text("\n".join([lines[0], *changed]) + "\n")
    events = {"file": "other.csv", **events}
    if shift:
        error = flight.refused(trajectory=trajectory, events=events)
        assert "gps_minus_utc_s (18 since 2017)" in error.remedy
    columns, _ = flight.imported(trajectory={**trajectory, "gps_minus_utc_s": 18.0}, events=events)
    assert errors(flight, columns)[0].max() < 1e-5


def test_a_flight_over_the_end_of_the_week_goes_on(flight):
    table = flight.samples()
    half = 0.5 * float(table[0, 0] + table[-1, 0])
    shift = 604_800.0 - half
    table[:, 0] = (table[:, 0] + shift) % 604_800.0
    accuracy = np.frombuffer((flight.folder / "smrmsg.out").read_bytes(), "<f8").reshape(-1, 10).copy()
    accuracy[:, 0] = (accuracy[:, 0] + shift) % 604_800.0
    lines = (flight.folder / "events.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    moved = [",".join([row[0], repr((float(row[1]) + shift) % 604_800.0), *row[2:]]) for row in rows]
    assert float(moved[0].split(",")[1]) > float(moved[-1].split(",")[1])
    (flight.folder / "sunday.csv").write_text("\n".join([lines[0], *moved]) + "\n")
    columns, _ = flight.imported(
        file=flight.write("sunday.sbet", table),
        trajectory={"accuracy": flight.write("sunday.out", accuracy)},
        events={"file": "sunday.csv"},
    )
    # Doubles of seconds keep 1e-10 s here: 7 nm at 60 m/s.
    assert errors(flight, columns)[0].max() < 1e-5
    assert np.all(np.diff(columns["time_s"]) > 0.0)


def test_velocities_and_rates_of_other_axes_are_not_used(flight):
    table = flight.samples()
    # Velocities north, east, up instead of those of the wander frame; rates forward, left, up.
    sine, cosine = np.sin(table[:, 10]), np.cos(table[:, 10])
    x, y = table[:, 4].copy(), table[:, 5].copy()
    table[:, 4], table[:, 5] = x * cosine - y * sine, -x * sine - y * cosine
    table[:, 15:] *= -1.0
    columns, problems = flight.imported(file=flight.write("axes.sbet", table))
    assert any("velocities do not agree with the changes of the positions" in text for text in problems)
    assert any("rates do not agree with the changes of the attitudes" in text for text in problems)
    metres, degrees, rates = errors(flight, columns)
    assert (metres.max() < 1e-3, degrees.max() < 2e-4, rates.max() < 1e-2) == (True, True, True)
    # Declared, the rates are right.
    columns, problems = flight.imported(file="axes.sbet", angles={"rate_axes": "forward-left-up"})
    assert not any("rates are" in text for text in problems)
    assert errors(flight, columns)[2].max() < 1e-6


def test_a_sample_that_does_not_belong_is_named(flight):
    table, moment = flight.samples(), float(np.sort(flight.block.truth.trajectory.time)[5])
    table[np.searchsorted(table[:, 0], moment), 3] += 3.0
    _, problems = flight.imported(file=flight.write("outlier.sbet", table))
    assert any("1 events lie near samples that are inconsistent" in text for text in problems)


def test_what_is_missing_in_the_declaration_is_named(flight):
    for changes, says in (
        ({"events": None}, "requires the times of the exposures"),
        ({"trajectory": None}, "clock of the trajectory is not declared"),
        ({"format": "csv"}, "belong to a trajectory"),
    ):
        with pytest.raises(ValueError, match=says):
            flight.source(**changes)
    error = flight.refused(angles={"unit": "deg"})
    assert error.remedy == 'Declare angles.unit = "rad".'


def test_positions_without_velocities_are_interpolated_by_their_own(flight):
    columns, problems = flight.imported(**solution_of(flight, [1]))
    place = local_from_map(flight.map_frame, flight.frame, stacked(columns, "x_m", "y_m", "z_m"))
    path, time = flown_path(flight.block.truth.plan, flight.block.truth.trajectory, 0), columns["time_s"]
    time = time - 2200 * 604_800
    true = path.position(time) + path.local_from_body(time) @ np.array(ARM)
    assert np.linalg.norm(place - true, axis=1).max() < 1e-3
    assert np.isnan(columns["heading_deg"]).all()
    np.testing.assert_allclose(columns["sigma_z_m"], 0.03)
    assert not any("solutions" in problem for problem in problems)


def test_float_solutions_are_said_weighted_or_left_out_as_declared(flight):
    declared = solution_of(flight, [2])
    _, problems = flight.imported(**declared)
    assert any("8 positions of float solutions" in text and "0.03 m" in text for text in problems)
    columns, _ = flight.imported(**declared, solutions={"float": 0.5})
    np.testing.assert_allclose(columns["sigma_x_m"], 0.5)
    columns, problems = flight.imported(**declared, solutions={"float": "leave-out"})
    assert np.isnan(columns["x_m"]).all()
    assert any("are excluded, as declared" in text for text in problems)


def test_solutions_of_a_file_that_states_none_are_refused(flight):
    error = flight.refused(solutions={"float": "leave-out"})
    assert "the file states none" in error.what


def test_marks_of_a_drone_lead_from_the_antenna_to_the_camera(flight):
    time = np.sort(flight.block.truth.trajectory.time) + OFFSET
    marks = "".join(
        f"{k}\t{moment:.9f}\t[2200]\t 1000,N\t 2000,E\t 3000,V\t48.9,Lat\t9.3,Lon\t1.0,Ellh\t1, 1, 1\t50,Q\n"
        for k, moment in enumerate(time.tolist(), start=1)
    )
    (flight.folder / "flight.MRK").write_text(marks)
    events = {"file": "flight.MRK", "format": "dji-mrk", "time": None}
    places = {}
    for position in ("antenna", "projection_centre"):
        columns, _ = flight.imported(**solution_of(flight, [1]), events=events, position=position)
        places[position] = local_from_map(
            flight.map_frame, flight.frame, stacked(columns, "x_m", "y_m", "z_m")
        )
    axes = np.asarray(flight.frame.local_from_enu(places["antenna"]))
    moved = np.einsum("nji,nj->ni", axes, places["projection_centre"] - places["antenna"])
    np.testing.assert_allclose(moved, np.tile([2.0, 1.0, -3.0], (8, 1)), rtol=0, atol=1e-6)


def test_the_path_that_is_shown_has_gaps_outliers_and_kinds_of_solutions(flight):
    table, time = flight.samples(), np.sort(flight.block.truth.trajectory.time)
    table[np.searchsorted(table[:, 0], time[5]), 3] += 3.0
    quiet = 0.5 * float(time[3] + time[4])
    flight.write("shown.sbet", table[np.abs(table[:, 0] - quiet) > 1.0])
    *_, (path,) = exposure_columns([flight.source(file="shown.sbet")], ("UCE-80",), flight.map_frame)
    assert len(path.time_s) < 2_100
    assert path.after_gap.sum() == 1
    assert path.time_s[path.after_gap][0] == pytest.approx(quiet + 1.0, abs=0.01)
    np.testing.assert_allclose(path.time_s[path.is_outlier], time[5], atol=0.01)
    source = flight.source(**solution_of(flight, [1, 1, 1, 2]))
    *_, (path,) = exposure_columns([source], ("UCE-80",), flight.map_frame)
    assert set(path.solution) == {"fixed", "float"}


@pytest.mark.parametrize("count", [20, pytest.param(500, marks=pytest.mark.slow)])
def test_damage_ends_in_exposures_or_one_sentence(flight, count):
    """Samples beside the events are what is interpolated: whatever stands there, nothing breaks."""
    table = flight.samples()
    near = (
        np.abs(table[:, 0, None] - np.sort(flight.block.truth.trajectory.time)[None, :4]).min(axis=1) < 0.03
    )
    table, random = table[near], np.random.default_rng(4)
    values = (0.0, -1.0, 1e-300, 1e15, np.nan, np.inf, 3.0, 600.0, 604_800.0)
    lines = (flight.folder / "events.csv").read_text().splitlines()[:5]
    (flight.folder / "few.csv").write_text("\n".join(lines) + "\n")
    sound, _ = flight.imported(file=flight.write("few.sbet", table), events={"file": "few.csv"})
    refused = 0
    for _ in range(count):
        damaged = table.copy()
        rows, columns = random.integers(0, len(table), 12), random.integers(0, 17, 12)
        damaged[rows, columns] = (
            random.choice(values, 12) if random.random() < 0.5 else random.normal(size=12)
        )
        flight.write("damaged.sbet", damaged[: random.integers(2, len(table))])
        try:
            found, _ = flight.imported(
                file="damaged.sbet", events={"file": "few.csv", "outside": "leave-out"}
            )
        except InputError:
            refused += 1
            continue
        assert found["image"].equals(sound["image"])
    assert 0 < refused < count


def test_samples_too_far_apart_for_the_motion_are_said(flight):
    flight.write("slow.sbet", flight.samples()[::2_000])
    columns, problems = flight.imported(file="slow.sbet")
    assert any("the samples are too far apart for this motion" in text for text in problems)
    assert errors(flight, columns)[0].max() > 0.1
    assert not any("too far apart" in text for text in flight.imported()[1])
