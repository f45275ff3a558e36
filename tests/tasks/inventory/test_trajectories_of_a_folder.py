"""``aerocal init`` in a folder with a trajectory: it belongs to its events, and nothing of it is guessed."""

from __future__ import annotations

import struct
import tomllib
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.inventory.folder import begin_project
from tasks.settings.base import PathContext
from tasks.settings.inputs import ExposuresInput
from tasks.settings.load import load_project
from tests.tasks.formats.sound_files import SOUND, content_of

WEEK_BEGIN = 345_600.0
EVENTS = "image,time,camera\n" + "".join(f"A{k},{WEEK_BEGIN + 1.0 + k},UCE\n" for k in range(3))
POINTS = "image,point,x,y\nA0,P1,1.5,2.5\nA1,P1,-1.5,2.5\n"
HEAD = "%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)\n"


def sbet(begin: float = WEEK_BEGIN, seconds: float = 10.0) -> bytes:
    return b"".join(
        struct.pack("<17d", begin + 0.1 * k, 0.85, 0.16 + 1e-6 * k, 2e3, *(0.0,) * 13)
        for k in range(int(10.0 * seconds))
    )


def smrmsg(begin: float = WEEK_BEGIN) -> bytes:
    return b"".join(
        struct.pack("<10d", begin + k, *(0.02,) * 3, *(0.005,) * 3, 0.2, 0.2, 0.5) for k in range(11)
    )


def solution(scale: str = "GPST") -> str:
    rows = (f"2264 {400_373 + k}.000 44.4282 1.2619 359.5 1 9 0.01 0.01 0.02\n" for k in range(5))
    return HEAD.replace("GPST", scale) + "".join(rows)


def marks(seconds: float = 400_373.488877) -> str:
    line = content_of(("events", "dji-mrk")).decode().partition("\t")[2]
    return f"1\t{line.replace('400373.488877', repr(seconds))}"


def begun(folder: Path, **files: str | bytes) -> tuple[dict, str]:
    """The project that init begins with these files, and its text."""
    for name, content in files.items():
        data = content.encode() if isinstance(content, str) else content
        (folder / name.replace("_", ".", 1)).write_bytes(data)
    begin_project(folder)
    text = (folder / "project.toml").read_text(encoding="utf-8")
    return tomllib.loads(text), text


def test_trajectory_accuracies_and_events_are_one_input(tmp_path: Path) -> None:
    project, text = begun(
        tmp_path, path_out=sbet(), rms_out=smrmsg(), shots_csv=EVENTS, points_csv=POINTS, late_out=smrmsg(0.0)
    )
    (exposures,) = project["inputs"]["exposures"]
    assert (exposures["file"], exposures["format"]) == ("path.out", "sbet")
    assert exposures["heights"] == "ellipsoidal"
    assert exposures["angles"] == {
        "order": "heading-pitch-roll",
        "unit": "rad",
        "reference": "true-north",
        "rate_axes": "forward-right-down",
    }
    assert exposures["trajectory"] == {
        # As many seconds are none of a day.
        "time": "DECLARE: gps-week or utc-week",
        "accuracy": "rms.out",
    }
    assert exposures["events"] == {
        "file": "shots.csv",
        "format": "csv",
        "time": "DECLARE: gps-week or utc-week",
    }
    for key in ("crs", "position", "strip"):
        assert exposures[key].startswith("DECLARE: ")
    assert list(project["cameras"]) == ["UCE"]
    assert "# 100 samples, 345600 to 345609.9 s, mostly 0.1 s apart" in text
    assert "# late.out: accuracies, 0 to 10 s, within none of the trajectories." in text
    with pytest.raises(InputError) as refused:
        load_project(tmp_path / "project.toml", [])
    for key in ("trajectory.time", "events.time", "position"):
        assert f"inputs.exposures.0.{key} (line " in refused.value.what


def test_what_init_writes_is_an_input_once_it_is_declared(tmp_path: Path) -> None:
    project, _ = begun(tmp_path, path_out=sbet(), shots_csv=EVENTS)
    (exposures,) = project["inputs"]["exposures"]
    exposures |= {"crs": "EPSG:4258", "position": "imu", "strip": "time-gaps"}
    exposures["trajectory"]["time"] = exposures["events"]["time"] = "gps-week"
    source = ExposuresInput.model_validate(exposures, context=PathContext(tmp_path))
    assert source.events is not None
    assert source.events.file == tmp_path / "shots.csv"


def test_events_are_of_the_trajectory_within_whose_times_they_lie(tmp_path: Path) -> None:
    day = 86_400.0
    later = EVENTS.replace("A", "B").replace("3456", "4320")
    project, _ = begun(
        tmp_path,
        monday_out=sbet(WEEK_BEGIN),
        tuesday_out=sbet(WEEK_BEGIN + day),
        first_csv=EVENTS,
        second_csv=later,
    )
    pairs = {(one["file"], one["events"]["file"]) for one in project["inputs"]["exposures"]}
    assert pairs == {("monday.out", "first.csv"), ("tuesday.out", "second.csv")}


def test_events_that_count_the_seconds_of_the_day_are_found_too(tmp_path: Path) -> None:
    rows = EVENTS.replace("3456", "")  # 345601.0 is second 1 of its day
    project, _ = begun(tmp_path, path_out=sbet(), shots_csv=rows)
    (exposures,) = project["inputs"]["exposures"]
    assert exposures["events"]["file"] == "shots.csv"
    assert exposures["events"]["time"] == "DECLARE: gps-week or utc-week or gps-day or utc-day"


def test_headings_of_others_and_dates(tmp_path: Path) -> None:
    rows = "ID;EVENT_TIME\nA0;2020/12/24 21:28:42.5\n"
    project, _ = begun(
        tmp_path, path_pos=content_of(("trajectory", "rtklib")), shots_txt=rows, points_csv=POINTS
    )
    (exposures,) = project["inputs"]["exposures"]
    events = exposures["events"]
    assert events["columns"] == {"image": "ID", "time": "EVENT_TIME"}
    assert (events["separator"], events["time"]) == ("semicolon", "DECLARE: gps-date or utc-date")
    assert "trajectory" not in exposures  # an RTKLIB solution states its clock
    assert "rate_axes" not in exposures["angles"]


def test_dji_marks_are_the_events_of_a_solution_and_exposures_without_one(tmp_path: Path) -> None:
    (tmp_path / "both").mkdir()
    project, text = begun(tmp_path / "both", rover_pos=solution(), Timestamp_MRK=marks(), points_csv=POINTS)
    (exposures,) = project["inputs"]["exposures"]
    assert (exposures["format"], exposures["events"]["format"]) == ("rtklib", "dji-mrk")
    assert exposures["position"].startswith("DECLARE: projection_centre (the offset from the antenna")
    assert exposures["image_names"].startswith("DECLARE: ")  # events are numbered, images are not
    assert "time" not in exposures["events"]
    assert "trajectory" not in exposures
    assert '# format = "dji-mrk"' in text  # its own positions, which are those of the same images
    (tmp_path / "alone").mkdir()
    project, text = begun(tmp_path / "alone", Timestamp_MRK=marks())
    (exposures,) = project["inputs"]["exposures"]
    assert (exposures["format"], exposures["position"]) == ("dji-mrk", "projection_centre")
    assert "times of exposures" not in text


def test_leap_seconds_are_asked_where_both_files_state_their_clocks(tmp_path: Path) -> None:
    project, _ = begun(tmp_path, rover_pos=solution("UTC"), Timestamp_MRK=marks(400_373.0 + 18.5))
    (exposures,) = project["inputs"]["exposures"]
    assert exposures["trajectory"]["gps_minus_utc_s"].startswith("DECLARE: ")


def test_a_trajectory_without_events_asks_for_them(tmp_path: Path) -> None:
    project, text = begun(tmp_path, path_out=sbet(), other_csv=EVENTS.replace("3456", "5999"))
    (exposures,) = project["inputs"]["exposures"]
    assert exposures["events"]["file"].startswith("DECLARE: ")
    assert "# other.csv: times of exposures, 599901 to 599903 s, within none of the trajectories." in text


def test_the_same_images_of_a_second_trajectory_are_left_to_a_person(tmp_path: Path) -> None:
    project, text = begun(tmp_path, forward_out=sbet(), smoothed_out=sbet(), shots_csv=EVENTS)
    assert len(project["inputs"]["exposures"]) == 1
    assert '# file = "smoothed.out"' in text
    assert "# [inputs.exposures.events]" in text


@pytest.mark.parametrize("key", [("exposures", "csv"), ("image points", "csv"), ("control", "csv")])
def test_a_damaged_table_of_another_kind_is_no_list_of_events(tmp_path: Path, key: tuple[str, str]) -> None:
    head, first, *rest = str(SOUND[key]).splitlines()
    more = ",time,image" if "image" not in head else ",time"
    damaged = "\n".join([head + more, f"{first},1.5,x,y,z", *rest])
    (tmp_path / "path.out").write_bytes(sbet())
    (tmp_path / "table.csv").write_text(damaged + "\n")
    begin_project(tmp_path)
    text = (tmp_path / "project.toml").read_text(encoding="utf-8")
    assert "table.csv" not in text
