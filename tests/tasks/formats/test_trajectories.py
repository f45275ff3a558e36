"""Readers of trajectories: published records, and each kind of damage."""

from __future__ import annotations

import numpy as np
import pytest

from tasks.errors import InputError
from tasks.formats.dji import read_mrk_events, read_mrk_exposures
from tasks.formats.native_csv import read_csv_events
from tasks.formats.rtklib import read_rtklib
from tasks.formats.sbet import read_sbet, read_smrmsg
from tasks.formats.trajectory_records import SOLUTIONS
from tests.tasks.formats.sound_files import content_of

MRK = content_of(("events", "dji-mrk")).decode()


def sbet_with(tmp_path, field, values):
    """The sound SBET with one field of its records changed."""
    table = np.frombuffer(content_of(("trajectory", "sbet")), "<f8").reshape(-1, 17).copy()
    table[:, field] = values
    path = tmp_path / "a.sbet"
    path.write_bytes(table.tobytes())
    return path


def refusal(reader, path, content, *more):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as raised:
        reader(path, *more)
    return raised.value


def test_velocities_of_the_published_records_are_those_of_their_positions(test_data):
    """PDAL's two records: only platform heading − wander, and its rotation of the velocities, fit."""
    records = read_sbet(test_data / "format_samples" / "sbet" / "2-points.sbet")
    longitude, latitude, height = np.diff(records.position, axis=0)[0] / np.diff(records.time_s)[0]
    radius = 6_371_000.0 * np.pi / 180.0
    east = longitude * radius * np.cos(np.radians(records.position[0, 1]))
    moved = np.array([east, latitude * radius, height])
    np.testing.assert_allclose(records.velocity[0], moved, rtol=0, atol=0.02)
    assert records.angles[0, 0] == pytest.approx(3.04677323 + 0.0219841474, abs=1e-8)
    assert records.rates[0] == pytest.approx([6.22680798e-05, 9.31216276e-03, 7.21781232e-02])


def test_published_accuracies_are_those_of_the_table_beside_them(test_data):
    folder = test_data / "format_samples" / "sbet"
    records = read_smrmsg(folder / "smrmsg_first100.out")
    table = np.loadtxt(folder / "smrmsg_first100.csv", delimiter=",", skiprows=1)[:100]
    np.testing.assert_allclose(records.time_s[: len(table)], table[:, 0])
    np.testing.assert_allclose(records.sigma_position[: len(table)], table[:, [2, 1, 3]], atol=1e-6)
    np.testing.assert_allclose(np.degrees(records.sigma_angles) * 60.0, table[:, [9, 8, 7]], atol=1e-6)


def test_a_published_solution_is_read_with_its_qualities(test_data):
    path = next((test_data / "format_samples" / "more" / "rtklib_pos").glob("*.pos"))
    records = read_rtklib(path)
    assert str(records.clock) == "GPS time, seconds of the date"
    # 2020-12-24 21:28:42 is second 422 922 of week 2137, as the header says.
    assert records.time_s[0] == 2137 * 604_800 + 422_922
    assert records.position[0].tolist() == [-105.147247371, 40.097025378, 1578.8456]
    assert records.sigma_position[0].tolist() == [1.3913, 1.4193, 2.9108]
    assert SOLUTIONS[records.solution[0]] == "float"


def test_weeks_and_seconds_are_the_same_times_as_dates(tmp_path):
    dates = content_of(("trajectory", "rtklib")).decode()
    path = tmp_path / "a.pos"
    path.write_text(dates)
    expected = read_rtklib(path).time_s
    path.write_text(
        dates.replace("2020/12/24 21:28:42.000", "2137 422922.000").replace(
            "2020/12/24 21:28:43.000", "2137 422923.000"
        )
    )
    assert read_rtklib(path).time_s.tolist() == expected.tolist()


def test_the_end_of_a_week_and_of_a_day_do_not_end_a_trajectory(tmp_path):
    for end in (604_800.0, 86_400.0):
        records = read_sbet(sbet_with(tmp_path, 0, [end - 0.01, end - 0.005, 0.0, 0.005]))
        np.testing.assert_allclose(np.diff(records.time_s), 0.005, atol=1e-9)


@pytest.mark.parametrize(
    ("field", "values", "says"),
    [
        (1, [0.1, 0.1, 2.0, 0.1], "Record 3"),
        (0, [1.0, 2.0, 2.0, 3.0], "Record 3 is not later"),
        (0, [-1.0, 2.0, 3.0, 4.0], "beyond the seconds of a week"),
        (16, [0.0, np.nan, 0.0, 0.0], "Record 2"),
    ],
)
def test_impossible_records_are_named(tmp_path, field, values, says):
    with pytest.raises(InputError) as raised:
        read_sbet(sbet_with(tmp_path, field, values))
    assert says in raised.value.what


def test_a_cut_trajectory_is_refused(tmp_path):
    error = refusal(read_sbet, tmp_path / "a.sbet", content_of(("trajectory", "sbet"))[:-1])
    assert "records of 136: 135 remain" in error.what
    error = refusal(read_smrmsg, tmp_path / "a.out", content_of(("accuracy", "smrmsg"))[:-8])
    assert "records of 80" in error.what


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("   Q  ns", "   X  ns", 3, "headings of the columns"),
        ("GPST  ", "JST   ", 3, "times are headed 'JST'"),
        ("latitude(deg)", "x-ecef(m)", 3, "lack latitude(deg)"),
        ("21:28:43", "21:28:42", 4, "is not later"),
        ("21:28:43", "21:61:43", 4, "not a date"),
        ("   1  11", "   9  11", 4, "quality Q other"),
        ("   0.1384   0.00", "", 4, "fields"),
        ("40.097025245", "140.097025245", 4, "is not a position on the earth"),
    ],
)
def test_damage_of_a_solution_is_named_with_its_line(tmp_path, old, new, line, says):
    text = content_of(("trajectory", "rtklib")).decode()
    assert old in text
    error = refusal(read_rtklib, tmp_path / "a.pos", text.replace(old, new, 1))
    assert says in error.what
    assert error.line == line


def test_a_solution_with_heights_above_a_geoid_is_refused(tmp_path):
    """Which the sound file does not say; RTKLIB writes it above the headings."""
    text, said = (
        content_of(("trajectory", "rtklib")).decode(),
        "% (lat/lon/height=WGS84/{},Q=1:fix,2:float)\n",
    )
    (tmp_path / "e.pos").write_text(said.format("ellipsoidal") + text)
    assert len(read_rtklib(tmp_path / "e.pos").time_s) > 1
    error = refusal(read_rtklib, tmp_path / "a.pos", said.format("geodetic") + text)
    assert "above the geoid" in error.what
    assert error.line == 1


def test_marks_have_the_camera_and_the_way_to_it(tmp_path):
    path = tmp_path / "a.MRK"
    path.write_text(MRK + MRK.replace("1\t", "2\t", 1).replace("50,Q", "0,Q"))
    records = read_mrk_exposures(path, "heading-pitch-roll")
    assert records.position[0].tolist() == [1.26196331, 44.42824637, 359.494]
    assert records.sigma_position[0].tolist() == [0.031, 0.028, 0.055]
    assert records.solution.to_pylist() == ["fixed", "none"]
    assert np.isnan(records.position[1]).all()
    events = read_mrk_events(path)
    np.testing.assert_allclose(events.from_antenna[0], [0.0, -0.040, -0.086], rtol=0, atol=1e-12)
    assert events.time_s[0] == 2264 * 604_800 + 400_373.488877


def test_a_line_that_is_no_mark_is_named(tmp_path):
    error = refusal(read_mrk_events, tmp_path / "a.MRK", MRK + "2\t400\t[2264]\n")
    assert error.line == 2
    error = refusal(read_mrk_events, tmp_path / "a.MRK", MRK.replace("44.42824637,Lat", "94.42824637,Lat"))
    assert "degrees" in error.what


@pytest.mark.parametrize(
    "text", ["2020-12-24T21:28:42+01:00", "24.12.2020 21:28:42", "2020-12-24", "422922.0"]
)
def test_a_text_that_is_no_date_with_a_time_is_shown_with_the_forms_of_one(tmp_path, text):
    path = tmp_path / "events.csv"
    path.write_text(f"image,time\na,{text}\n")
    with pytest.raises(InputError) as refused:
        read_csv_events(path, "date")
    for part in (f"'{text}'", "2020-12-24T21:28:42.000", "2020/12/24 21:28:42.000", "without a time zone"):
        assert part in str(refused.value)


@pytest.mark.parametrize("text", ["2020-12-24T21:28:42", "21:28:42"])
def test_a_time_of_day_in_the_place_of_seconds_is_named(tmp_path, text):
    path = tmp_path / "events.csv"
    path.write_text(f"image,time\na,{text}\n")
    with pytest.raises(InputError) as refused:
        read_csv_events(path, "week")
    assert f"'{text}' in the column 'time' is not a number. Write seconds, such as 422922.000." in str(
        refused.value
    )
    assert 'time = "gps-date" or "utc-date"' in str(refused.value)
