from __future__ import annotations

import numpy as np
import pytest

from tasks.errors import InputError


def test_image_points_come_out_in_millimetres_sorted_by_image_and_point(delivery):
    table = delivery.table(delivery.image_points(), "image_points")
    assert list(zip(table["image"], table["point"], strict=True)) == [
        ("I1", "P1"),
        ("I1", "P2"),
        ("I2", "C1"),
        ("I2", "P1"),
        ("I2", "P2"),
        ("I3", "C1"),
        ("I3", "P2"),
    ]
    assert table.loc[0, ["x_mm", "y_mm"]].tolist() == [10.5, -3.25]
    # The default is 0.3 px of 5 µm.
    np.testing.assert_allclose(table[["sigma_x_mm", "sigma_y_mm"]], 0.0015, rtol=1e-12)


def test_pixels_are_counted_from_the_corner_or_the_centre_of_the_first_pixel(delivery):
    delivery.write(points="image,point,x,y\nI1,P,0,0\nI2,P,10000,8000\n").change("project", '"mm"', '"px"')
    corner = delivery.table(delivery.image_points(), "image_points")
    np.testing.assert_allclose(corner[["x_mm", "y_mm"]], [[-25.0, 20.0], [25.0, -20.0]], atol=1e-12)
    centre = delivery.table(delivery.image_points("cameras.CAM.pixel_origin=centre"), "image_points")
    np.testing.assert_allclose(
        centre[["x_mm", "y_mm"]], corner[["x_mm", "y_mm"]] + [0.0025, -0.0025], atol=1e-12
    )


def test_a_rows_sigma_beats_the_inputs_and_both_are_in_the_declared_unit(delivery):
    delivery.write(points="image,point,x,y,sx,sy\nI1,P,1000,0,2,3\nI2,P,-20000,0,,4\n").change(
        "project", '"mm"', '"um"'
    )
    table = delivery.table(delivery.image_points("inputs.image_points.sigma=[1.0, 1.5]"), "image_points")
    np.testing.assert_allclose(table[["sigma_x_mm", "sigma_y_mm"]], [[0.002, 0.003], [0.001, 0.004]])


def test_single_ray_points_are_dropped_counted_and_said(delivery):
    outputs = delivery.image_points()
    assert "lonely" not in set(delivery.table(outputs, "image_points")["point"])
    notes = delivery.notes(outputs)
    assert notes.figures["counts"]["single_ray_points"] == 1
    assert any("1 point is measured in one image only" in sentence for sentence in notes.problems)


def test_a_control_point_in_one_image_only_is_kept_when_control_is_known(delivery):
    delivery.change("points", "I1,lonely,0,0", "I1,C2,0,0")
    assert "C2" not in set(delivery.table(delivery.image_points(), "image_points")["point"])
    assert "C2" in set(delivery.table(delivery.image_points(control=True), "image_points")["point"])


def test_exposures_without_image_points_are_counted(delivery):
    delivery.change("exposures", "I3,CAM", "I4,CAM,S2,500900,5300200,2002,0,0,0\nI3,CAM")
    notes = delivery.notes(delivery.image_points())
    assert notes.figures["counts"]["exposures_without_image_points"] == 1
    assert any("1 of 4 exposures has no image points" in sentence for sentence in notes.problems)


def test_several_files_are_read_as_one(delivery):
    delivery.write(more="image,point,x,y,method\nI1,lonely2,1,1,manual\nI3,lonely2,2,2,manual\n")
    delivery.change("project", "[inputs.image_points]", "[[inputs.image_points]]")
    delivery.change(
        "project",
        "[inputs.exposures]",
        '[[inputs.image_points]]\nfile = "more.csv"\nformat = "csv"\nunit = "mm"\n[inputs.exposures]',
    )
    table = delivery.table(delivery.image_points(), "image_points").set_index(["image", "point"])
    assert table.loc[("I1", "lonely2"), "method"] == "manual"
    assert table["method"].isna().sum() == len(table) - 2


def test_a_point_measured_twice_in_an_image_names_both_lines(delivery):
    delivery.change("points", "I1,lonely,0,0", "I1,P1,10.6,-3.2")
    with pytest.raises(InputError) as raised:
        delivery.image_points()
    assert raised.value.line == 9
    assert "line 2" in raised.value.what
    assert raised.value.entity == "'P1' in 'I1'"


def test_duplicates_in_two_files_name_the_other_file(delivery):
    delivery.write(more="image,point,x,y\nI2,P1,1,1\n").change(
        "project", "[inputs.image_points]", "[[inputs.image_points]]"
    )
    delivery.change(
        "project",
        "[inputs.exposures]",
        '[[inputs.image_points]]\nfile = "more.csv"\nformat = "csv"\nunit = "mm"\n[inputs.exposures]',
    )
    with pytest.raises(InputError, match=r"more.csv:2: .*line 3 of .*points.csv"):
        delivery.image_points()


def test_an_unknown_image_is_named_with_its_nearest_known_name_its_count_and_its_line(delivery):
    delivery.change("points", "I1,P1", "i1x,P1").change("points", "I1,P2", "i1x,P2")
    with pytest.raises(InputError) as raised:
        delivery.image_points()
    assert (raised.value.file.name, raised.value.line, raised.value.entity) == ("points.csv", 2, "i1x")
    assert "2 image points" in raised.value.what
    assert "Did you mean 'I1'?" in raised.value.remedy


@pytest.mark.parametrize(
    ("written", "declared", "factor"),
    [("um", "mm", 1000.0), ("mm", "um", 1.0), ("um", "px", 1000.0), ("mm", "px", 1.0)],
)
def test_a_wrong_unit_is_an_error_that_names_the_unit_that_fits(delivery, written, declared, factor):
    rows = [
        ("I1", "P1", 10.5, -3.25),
        ("I2", "P1", -9.5, -3.5),
        ("I1", "P2", 24.9, 19.9),
        ("I2", "P2", 4, 19),
    ]
    lines = [f"{image},{point},{x * factor},{y * factor}" for image, point, x, y in rows]
    delivery.write(points="\n".join(["image,point,x,y", *lines]) + "\n")
    delivery.change("project", '"mm"', f'"{declared}"')
    with pytest.raises(InputError) as raised:
        delivery.image_points()
    assert f'unit = "{written}"' in raised.value.remedy
    assert raised.value.line is not None


def test_pixels_declared_as_millimetres_are_an_error_that_names_px(delivery):
    delivery.write(points="image,point,x,y\nI1,P1,7100,4650\nI2,P1,3100,4700\n")
    with pytest.raises(InputError, match='unit = "px"'):
        delivery.image_points()


def test_pixels_declared_as_micrometres_are_a_named_suspicion(delivery):
    generator = np.random.default_rng(4)
    xy = generator.uniform([0.0, 0.0], [9999.0, 7999.0], size=(60, 2))
    lines = [f"I{1 + i % 2},P{i // 2},{x:.2f},{y:.2f}" for i, (x, y) in enumerate(xy)]
    delivery.write(points="\n".join(["image,point,x,y", *lines]) + "\n").change("project", '"mm"', '"um"')
    problems = delivery.notes(delivery.image_points()).problems
    assert any("one quarter of the image" in p and 'unit = "px"' in p for p in problems)


def test_one_point_outside_the_image_is_named(delivery):
    delivery.change("points", "I3,P2,-16,18", "I3,P2,-16,20.5")
    with pytest.raises(InputError) as raised:
        delivery.image_points()
    assert (raised.value.line, raised.value.entity) == (6, "P2")
    assert "1 of 8 points" in raised.value.what


def scattered(factor: float = 1.0, outside: int = 0, count: int = 1000) -> str:
    """Image points all over the format (mm × factor), the first few outside of it."""
    xy = np.random.default_rng(4).uniform([-25.0, -20.0], [25.0, 20.0], size=(count, 2))
    xy[:outside] = [40.0, 1.0]
    lines = [f"I{1 + i % 2},P{i // 2},{x * factor:.4f},{y * factor:.4f}" for i, (x, y) in enumerate(xy)]
    return "\n".join(["image,point,x,y", *lines]) + "\n"


def test_few_points_outside_the_format_are_left_out_and_said(delivery):
    delivery.write(points=scattered(outside=1))
    outputs = delivery.image_points()
    notes = delivery.notes(outputs)
    # With one of two rays lost, the point has a single one left.
    assert len(delivery.table(outputs, "image_points")) == 998
    assert notes.figures["counts"]["outside_format"] == 1
    assert notes.figures["counts"]["image_points_read"] == 1000
    said = next(text for text in notes.problems if "outside their image" in text)
    assert said == (
        "points.csv: 1 of 1,000 points lie outside their image and are ignored; the first is 'P0' in 'I1' "
        "(line 2)."
    )


@pytest.mark.parametrize("share", ["0", "0.001"])
def test_more_points_outside_than_the_share_are_an_error_without_another_unit(delivery, share):
    delivery.write(points=scattered(outside=1 if share == "0" else 2))
    with pytest.raises(InputError) as raised:
        delivery.image_points(f"checks.outside_format_share={share}")
    assert raised.value.line == 2
    assert "of 1,000 points do" in raised.value.what
    assert "unit =" not in raised.value.remedy


def test_a_share_that_is_stated_is_left_out(delivery):
    delivery.write(points=scattered(outside=100))
    outputs = delivery.image_points("checks.outside_format_share=0.1")
    assert delivery.notes(outputs).figures["counts"]["outside_format"] == 100


def test_another_unit_is_named_where_it_fits_better_though_not_all_fit(delivery):
    delivery.write(points=scattered(1000.0, outside=20))
    with pytest.raises(InputError) as raised:
        delivery.image_points()
    assert 'In µm 98 % of them would fit: declare unit = "um"' in raised.value.remedy


def test_a_pixel_outside_the_border_is_still_inside(delivery):
    delivery.change("points", "I3,P2,-16,18", "I3,P2,-25.004,20.004")
    assert len(delivery.table(delivery.image_points(), "image_points")) == 7


@pytest.mark.parametrize("sigma", ["0", "-0.002"])
def test_a_sigma_that_is_not_positive_is_an_error(delivery, sigma):
    delivery.write(points=f"image,point,x,y,sx,sy\nI1,P,1,1,0.001,0.001\nI2,P,1,1,{sigma},0.001\n")
    with pytest.raises(InputError) as raised:
        delivery.image_points()
    assert (raised.value.line, raised.value.entity) == (3, "P")


@pytest.mark.parametrize("value", ["nan", "NaN", "inf", "-inf", "abc", ""])
def test_a_coordinate_that_is_no_number_names_its_line(delivery, value):
    delivery.change("points", "I2,P2,4,19", f"I2,P2,{value},19")
    with pytest.raises(InputError) as raised:
        delivery.image_points()
    assert (raised.value.file.name, raised.value.line) == ("points.csv", 5)


def test_two_hundred_thousand_rows_are_read_without_loss(delivery):
    count = 200_000
    lines = [f"I{1 + i % 2},P{i // 2},{(i * 7) % 40 - 20},{(i * 3) % 30 - 15}" for i in range(count)]
    delivery.write(points="\n".join(["image,point,x,y", *lines]) + "\n")
    assert len(delivery.table(delivery.image_points(), "image_points")) == count
