"""Calibration reports of film cameras: read, converted, and refused in a wrong unit."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from tasks.deliveries.cameras import camera_record, camera_table
from tasks.deliveries.fiducials import fiducials_of
from tasks.deliveries.film_reports import about_film_reports
from tasks.errors import InputError
from tasks.settings.cameras import CameraInput

#: K0, K1, K2 of the lens, metres.
TRUE = (1.1e-4, -1.5e-2, 0.45)
RADII_MM = tuple(range(10, 150, 10))

REPORT = """
[camera]
serial = "5282"
lens = "13389"
focal_length_mm = 153.012
ppa_mm = [0.004, -0.002]
pps_mm = [0.011, 0.006]
principal_point = "pps"

[fiducials_mm]
1 = [-106.001, -106.002]
2 = [106.003, 105.999]
3 = [-106.000, 106.001]
4 = [105.998, -106.003]

[distortion]
unit = "um"
positive = "outward"
sigma = 0.03
radius_mm = [RADII]
mean = [MEAN]
"""


def outward_um(radius_mm: float) -> float:
    r = 1e-3 * radius_mm
    return -1e6 * sum(value * r ** (2 * power + 1) for power, value in enumerate(TRUE))


def report(**changes: str) -> str:
    """The report of the lens to 0.1 µm, with some lines replaced."""
    mean = ", ".join(f"{outward_um(radius):.1f}" for radius in RADII_MM)
    text = REPORT.replace("RADII", ", ".join(map(str, RADII_MM))).replace("MEAN", mean)
    for key, value in changes.items():
        text = re.sub(rf"(?m)^{key} = .*$", lambda _, line=f"{key} = {value}": line, text)
    return text


def camera(folder: Path, text: str, **values: object) -> CameraInput:
    path = folder / "report.toml"
    path.write_text(text)
    given = {"columns": 16430, "rows": 16430, "pixel_um": 14.0, "pixel_origin": "corner", "mount_deg": 0}
    return CameraInput.model_validate({**given, "calibration_report": path, **values})


def test_the_camera_of_a_report_is_that_of_its_lens(tmp_path: Path) -> None:
    read = camera(tmp_path, report())
    record = camera_record(read)
    assert record.focal_length_mm == pytest.approx(153.012 / (1.0 + TRUE[0]), abs=5e-4)
    assert record.principal_point_mm == (0.011, 0.006)
    assert record.additional_parameters.keys() == {"brown:K1", "brown:K2"}
    for name, value in zip(("brown:K1", "brown:K2"), TRUE[1:], strict=True):
        assert record.additional_parameters[name] == pytest.approx(value, rel=0.03)
    assert fiducials_of(read)["2"] == (106.003, 105.999)
    (row,) = camera_table({"RMK": read}).to_dict("records")
    assert row["principal_point_x_mm"] == 0.011
    assert "brown:K1" in row["additional_parameters"]


def test_what_was_taken_is_said_with_its_misfit(tmp_path: Path) -> None:
    (sentence,) = about_film_reports({"RMK": camera(tmp_path, report())})
    assert "calibration report of 5282: c 152.99" in sentence
    assert "4 fiducial marks, radial distortion as K0, K1, K2: RMS misfit 0.0" in sentence
    rough = report(sigma="0.0301", mean=f"[{', '.join('9.0' if r % 20 else '-9.0' for r in RADII_MM)}]")
    found = about_film_reports({"RMK": camera(tmp_path, rough)})
    assert "does not agree with its parameters" in found[1]
    assert "stated σ 0.03 µm" in found[1]


@pytest.mark.parametrize("kind", ["inward", "mm", "angles", "semi-diagonals"])
def test_every_way_to_print_the_same_distortion_gives_the_same_camera(kind: str, tmp_path: Path) -> None:
    um = [round(outward_um(radius), 1) for radius in RADII_MM]
    angles = [float(np.rad2deg(np.arctan(radius / 153.012))) for radius in RADII_MM]
    changed = {
        "inward": report(positive='"inward"', mean=str([-value for value in um])),
        "mm": report(unit='"mm"', sigma="3e-5", mean=str([1e-3 * value for value in um])),
        "angles": report().replace("radius_mm", "angle_deg").replace(str(list(RADII_MM)), str(angles)),
        "semi-diagonals": report().replace(
            "mean = ", f"semi_diagonals = {{ 45 = {um}, 135 = {um}, 225 = {um}, 315 = {um} }}\n# "
        ),
    }[kind]
    expected, found = camera_record(camera(tmp_path, report())), camera_record(camera(tmp_path, changed))
    assert found.focal_length_mm == pytest.approx(expected.focal_length_mm, abs=5e-5)
    for name, value in expected.additional_parameters.items():
        assert found.additional_parameters[name] == pytest.approx(value, rel=2e-3)
    # Alike in all directions: no decentring.
    for name in found.additional_parameters.keys() - expected.additional_parameters.keys():
        assert abs(found.additional_parameters[name]) < 1e-9


def test_an_offset_from_the_principal_point_gives_a_decentring(tmp_path: Path) -> None:
    record = camera_record(camera(tmp_path, report(principal_point='"ppa"')))
    assert record.principal_point_mm == (0.004, -0.002)
    assert {"brown:P1", "brown:P2"} <= record.additional_parameters.keys()
    # In axes turned by 90° the offset (7, 8) µm is (8, −7) µm.
    turned = camera_record(camera(tmp_path, report(principal_point='"ppa"'), calibration_axes_deg=90))
    p1, p2 = (record.additional_parameters[f"brown:{name}"] for name in ("P1", "P2"))
    assert turned.additional_parameters["brown:P1"] == pytest.approx(p2)
    assert turned.additional_parameters["brown:P2"] == pytest.approx(-p1)


@pytest.mark.parametrize(
    ("changes", "words", "line"),
    [
        ({"unit": '"mm"'}, r"In mm the largest distortion would be .* lens; in um it is", 16),
        ({"mean": str([1e-3 * 0.01] * 14)}, "In um the largest distortion would be 1e-05 µm", 16),
        ({"pps_mm": "[11.0, 6.0]"}, "12.53 mm from the origin .* 12.53 µm are 0.01253 mm", 2),
        ({"focal_length_mm": "0.153012"}, "focal length of 0.153012 mm .* no film camera", None),
        ({"focal_length_mm": "-153.0"}, "greater than 0", 5),
        ({"1": "[-106001.0, 106002.0]"}, "Fiducial marks 106002 mm from the centre", None),
        ({"radius_mm": str([0.1 * r for r in RADII_MM])}, "stated up to 14 mm from the centre", None),
        ({"radius_mm": str([10, 20, 20, *RADII_MM[3:]])}, "do not ascend", 16),
        ({"mean": "[0.1, 0.2]"}, "14 places, but 2 values", 16),
        ({"mean": "[0.1, 0.2]\nangle_deg = [1.0, 2.0]"}, "no places, or two kinds", 16),
        ({"sigma": "0.03\nsemi_diagonals = { 45 = [0.1] }"}, "no values, or two kinds", 16),
        ({"mean": "[]\nsemi_diagonals = { 400 = [0.1] }"}, "'400' is not the direction", None),
        ({"positive": '"up"'}, "'outward' or 'inward'", 18),
        ({"serial": '"5282"\nlense = "1"'}, "lense", 4),
    ],
)
def test_bad_reports_are_refused_with_their_line(
    changes: dict[str, str], words: str, line: int | None, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=words) as refused:
        camera_record(camera(tmp_path, report(**changes)))
    assert refused.value.file == tmp_path / "report.toml"
    if line is not None:
        assert refused.value.line == line


def test_one_semi_diagonal_or_value_is_no_table(tmp_path: Path) -> None:
    one = report().replace("mean = ", f"semi_diagonals = {{ 45 = {[0.1] * 14} }}\n# ")
    with pytest.raises(InputError, match="one semi-diagonal only"):
        camera_record(camera(tmp_path, one))
    with pytest.raises(InputError, match="fewer values than parameters"):
        camera_record(camera(tmp_path, report(radius_mm="[100]", mean="[1.0]")))


def test_the_report_of_another_camera_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is of lens 13389, and the images are of lens 13365"):
        camera_record(camera(tmp_path, report(), identity={"body": "5282", "lens": "13365"}))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"focal_length_mm": 153.0}, "calibration_report and also focal_length_mm"),
        ({"fiducials_mm": {"1": (1.0, 1.0)}}, "calibration_report and also fiducials_mm"),
        ({"additional_parameters": {"brown:K1": 1e-3}}, "calibration_report and also brown:K1"),
        ({"calibration": "registry"}, "and also a registered calibration"),
        ({"pixel_um": None}, "lacks pixel_um"),
    ],
)
def test_what_the_report_states_is_not_declared_twice(
    values: dict[str, object], words: str, tmp_path: Path
) -> None:
    with pytest.raises(ValidationError, match=words):
        camera(tmp_path, report(), **values)
