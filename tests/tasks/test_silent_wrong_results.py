"""Deliveries that are well formed and wrong: refused, or named, before anything is computed with them."""

from __future__ import annotations

import pytest

from tasks.errors import InputError
from tests.grids import pairs_daily

SIGMAS = {
    "control": (
        "point,x,y,z,sx,sy,sz\nC1,500600,5300150,450.5,{0},0.02,0.02\nC2,500100,5300050,440,0.02,0.02,{1}\n"
    ),
    "points": "image,point,x,y,sx,sy\nI1,P1,10.5,-3.25,{0},0.001\nI2,P1,-9.5,-3.5,0.001,{1}\n",
    "exposures": (
        "image,camera,strip,x,y,z,omega,phi,kappa,sx,sy,sz,somega,sphi,skappa\n"
        "I1,CAM,S1,500000,5300000,2000,0.1,-0.2,10,{0},0.05,0.05,0.01,0.01,0.01\n"
        "I2,CAM,S1,500400,5300100,2001,0.2,-0.1,11,0.05,0.05,0.05,0.01,0.01,{1}\n"
        "I3,CAM,S2,500800,5300200,2002,-0.3,0.1,-170,0.05,0.05,0.05,0.01,0.01,0.01\n"
    ),
}
SOUND = {"control": "0.02", "points": "0.001", "exposures": "0.01"}


def read(delivery, name, *overrides):
    """Run the import stage of a file."""
    stages = {"control": delivery.control, "points": delivery.image_points, "exposures": delivery.exposures}
    return stages[name](*overrides)


@pytest.mark.parametrize(
    ("name", "wrong", "place"),
    pairs_daily(tuple(SIGMAS), ("1e300", "1e14", "1e-9", "1e-300", "-1e-9"), (0, 1)),
)
def test_a_sigma_that_no_measurement_has_is_refused_with_its_row(delivery, name, wrong, place):
    """A sound one is read by the test below."""
    given = [SOUND[name]] * 2
    given[place] = wrong
    with pytest.raises(InputError, match=r"standard deviation .* cannot be|is 1e\+300 here") as error:
        read(delivery.write(**{name: SIGMAS[name].format(*given)}), name)
    assert error.value.line == 2 + place


@pytest.mark.parametrize("name", SIGMAS)
def test_a_sigma_left_empty_beside_others_is_named_with_what_holds(delivery, name):
    sound = SOUND[name]
    outputs = read(delivery.write(**{name: SIGMAS[name].format(sound, sound)}), name)
    assert not any("have no standard deviation" in said for said in delivery.notes(outputs).problems)
    outputs = read(delivery.write(**{name: SIGMAS[name].format(sound, "")}), name)
    (said,) = [said for said in delivery.notes(outputs).problems if "have no standard deviation" in said]
    assert said.startswith(f"{name}.csv: 1 of {3 if name == 'exposures' else 2} rows")


def test_sigmas_that_no_row_gives_are_no_remark(delivery):
    for name in SIGMAS:
        assert not any("empty" in said for said in delivery.notes(read(delivery, name)).problems)


def copies(points: str, image: str, name: str) -> str:
    """The rows of an image again under another name."""
    rows = [row for row in points.splitlines() if row.startswith(f"{image},")]
    return points + "".join(row.replace(image, name, 1) + "\n" for row in rows)


def test_an_image_delivered_twice_is_refused_with_both_names(delivery):
    delivery.change("exposures", "I3,CAM", "J2,CAM,S3,500400,5300100,2001,0.2,-0.1,11\nI3,CAM")
    delivery.write(points=copies(delivery.texts["points"], "I2", "J2"))
    with pytest.raises(
        InputError, match=r"3 points of the image 'I2' lie in 'J2' at exactly the same position"
    ) as e:
        delivery.image_points()
    assert "2 of 4 images share most" in e.value.what
    assert e.value.entity == "J2"
    # Half of the points and less may be measured at the same place, as fiducial-like targets are.
    delivery.write(
        points=delivery.texts["points"].replace("J2,P1,-9.5", "J2,P1,-9.4").replace("J2,C1,20,3", "")
    )
    assert delivery.image_points()


def test_all_images_delivered_twice_are_counted(delivery):
    exposures, points = delivery.texts["exposures"], delivery.texts["points"]
    for k in (1, 2, 3):
        for n in range(9):
            points += f"I{k},T{k}{n},{n},{k + n / 7}\nI{k % 3 + 1},T{k}{n},{-n},{k}\n"
    rows = exposures.splitlines()[1:]
    delivery.write(exposures=exposures + "".join("again-" + row + "\n" for row in rows))
    for name in ("I1", "I2", "I3"):
        points = copies(points, name, f"again-{name}")
    with pytest.raises(InputError, match="6 of 6 images share most of their points"):
        delivery.write(points=points).image_points()


def test_one_image_point_determines_nothing(delivery):
    delivery.write(points="image,point,x,y\nI1,C1,1,2\n")
    for control in (False, True):
        with pytest.raises(InputError, match=r"No point is measured in two images \(1 image points in all\)"):
            delivery.image_points(control=control)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("cameras.CAM.pixel_um=5000.0", "images up to 600 mm"),
        ("cameras.CAM.pixel_um=0.005", "Pixels are 0.3 to 300 µm"),
        ("cameras.CAM.pixel_um=100", "make an image of 1000 mm"),
        ("cameras.CAM.focal_length_mm=0.08", "A focal length of 0.08 mm with an image of 50 mm"),
        ("cameras.CAM.focal_length_mm=80000", "focal_length_mm is in mm"),
        ("cameras.CAM.principal_point_mm=[5000.0, 4000.0]", "from the centre of the image, in mm"),
        ("cameras.CAM.principal_point_mm=[0.0, -45.0]", "lies outside the image of 50 × 40 mm"),
    ],
)
def test_a_length_in_another_unit_makes_no_camera(delivery, override, words):
    with pytest.raises(InputError, match=words) as refused:
        delivery.exposures(override)
    assert refused.value.entity == "cameras.CAM"


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("cameras.CAM.pixel_um", '"5.0"'),
        ("cameras.CAM.columns", '"10000"'),
        ("cameras.CAM.columns", "true"),
        ("cameras.CAM.mount_deg", "false"),
        ("cameras.CAM.principal_point_mm", '["0.01", "-0.02"]'),
        ("cameras.CAM.lever_arm_m", "[true, 0.0, 0.0]"),
        ("cameras.CAM.additional_parameters", '{ "bluh:9" = "1e-9" }'),
        ("version", "true"),
        ("inputs.control.sigma_m", '"0.02"'),
        ("inputs.control.sigma_m", "true"),
        ("adjustment.max_iterations", '"20"'),
        ("gates.sigma0", '{ max = "1.5" }'),
    ],
)
def test_a_text_is_no_number_and_true_is_none_either(delivery, key, value):
    with pytest.raises(InputError, match=r"is not allowed here|is not a list") as error:
        delivery.project(f"{key}={value}")
    assert error.value.entity == f"--set {key}={value}"


@pytest.mark.parametrize("seams", ["[10.0, -10.0]", "[5.0, 5.0]"])
def test_seams_that_do_not_ascend_are_refused(delivery, seams):
    with pytest.raises(InputError, match="do not ascend"):
        delivery.project(f"cameras.CAM.tiles={{ seams_x_mm = {seams}, seams_y_mm = [0.0] }}")
    tiles = (
        delivery.project("cameras.CAM.tiles={ seams_x_mm = [-5, 5.0], seams_y_mm = [] }").cameras["CAM"].tiles
    )
    assert tiles.seams_x_mm == (-5.0, 5.0)
