from __future__ import annotations

import numpy as np
import pytest

from tasks.coordinates.crs import MapFrame
from tasks.deliveries.control import control_columns
from tasks.errors import InputError
from tasks.settings.coordinates import ELLIPSOIDAL, Heights
from tasks.settings.inputs import ControlInput

XYZ = ["x_m", "y_m", "z_m"]
SIGMA = ["sigma_x_m", "sigma_y_m", "sigma_z_m"]


def test_control_points_keep_their_digits_and_get_the_inputs_sigma(delivery):
    table = delivery.table(delivery.control("inputs.control.sigma_m=[0.02, 0.03, 0.04]"), "control_points")
    assert table["point"].tolist() == ["C1", "C2"]
    assert table.loc[0, XYZ].tolist() == [500600.0, 5300150.0, 450.5]
    assert table.loc[1, SIGMA].tolist() == [0.02, 0.03, 0.04]
    assert set(table["role"]) == {"control"}


def test_an_empty_coordinate_is_not_known_and_has_no_sigma(delivery):
    delivery.write(control="point,x,y,z\nplan,500600,5300150,\nheight,,,440\n")
    table = delivery.table(delivery.control(), "control_points").set_index("point")
    assert table.loc["plan", "z_m"] is None or np.isnan(table.loc["plan", "z_m"])
    assert np.isnan(table.loc["plan", "sigma_z_m"])
    assert table.loc["plan", "sigma_x_m"] == 0.05
    assert table.loc["height", XYZ].isna().tolist() == [True, True, False]


def test_a_point_known_in_plan_only_can_change_its_projection(delivery):
    here, there = MapFrame.of("EPSG:32632", ELLIPSOIDAL), MapFrame.of("EPSG:32633", ELLIPSOIDAL)
    place = np.array([[700000.0, 5300000.0, 0.0]])
    x, y, _ = there.from_geodetic(here.to_geodetic(place))[0]
    delivery.write(control=f"point,x,y,z\nplan,{x:.9f},{y:.9f},\n")
    delivery.change(
        "project",
        'control.csv"\nformat = "csv"\ncrs = "EPSG:32632"',
        'control.csv"\nformat = "csv"\ncrs = "EPSG:32633"',
    )
    row = delivery.table(delivery.control(), "control_points").iloc[0]
    np.testing.assert_allclose(row[["x_m", "y_m"]].to_numpy(float), place[0, :2], atol=1e-6)
    assert np.isnan(row["z_m"])


def test_a_point_known_in_height_only_needs_a_place_to_change_its_height_system(delivery, test_data):
    grid = test_data / "ign_borea_uce_m3" / "fr_ign_RAF20.tif"
    delivery.write(control="point,x,y,z\nC1,,,440\n")
    with pytest.raises(InputError, match="requires a horizontal position"):
        delivery.control(f'inputs.control.heights={{geoid="{grid}"}}')


def test_one_missing_plan_coordinate_is_an_error(delivery):
    delivery.write(control="point,x,y,z\nC1,500600,,440\n")
    with pytest.raises(InputError) as raised:
        delivery.control()
    assert (raised.value.line, raised.value.entity) == (2, "C1")


def test_roles_come_from_the_row_the_list_and_the_input_in_this_order_of_strength(delivery):
    delivery.write(
        control="point,x,y,z,role\nA,500600,5300150,1,check\nB,500600,5300150,1,\nC,500600,5300150,1,control\n"
    )
    plain = delivery.table(delivery.control(), "control_points")
    assert plain["role"].tolist() == ["check", "control", "control"]
    listed = delivery.table(delivery.control('inputs.control.check_points=["C"]'), "control_points")
    assert listed["role"].tolist() == ["check", "control", "check"]
    default = delivery.control("inputs.control.role=check")
    assert delivery.table(default, "control_points")["role"].tolist() == ["check", "check", "control"]
    assert delivery.notes(default).figures["counts"] == {"control": 1, "check": 2}


def test_an_unknown_role_and_an_unknown_check_point_are_errors(delivery):
    with pytest.raises(InputError, match="Did you mean 'C1'"):
        delivery.control('inputs.control.check_points=["c1"]')
    delivery.write(control="point,x,y,z,role\nA,500600,5300150,1,chek\n")
    with pytest.raises(InputError, match="The role 'chek' does not exist"):
        delivery.control()


def test_a_point_given_twice_names_both_lines(delivery):
    delivery.change("control", "C2,", "C1,")
    with pytest.raises(InputError) as raised:
        delivery.control()
    assert raised.value.line == 3
    assert "line 2" in raised.value.what


def test_swapped_x_and_y_of_control_are_said(delivery):
    delivery.write(control="point,x,y,z\nC1,5300150,500600,450.5\nC2,5300050,500100,440\n")
    with pytest.raises(InputError) as raised:
        delivery.control()
    assert (raised.value.line, raised.value.entity) == (2, "C1")
    assert "x and y look swapped" in raised.value.remedy


@pytest.mark.parametrize("value", ["nan", "inf", "4 40"])
def test_a_height_that_is_no_number_names_its_line(delivery, value):
    delivery.change("control", "5300050,440", f"5300050,{value}")
    with pytest.raises(InputError) as raised:
        delivery.control()
    assert raised.value.line == 3


def test_no_control_gives_an_empty_table(delivery):
    start = delivery.texts["project"].index("[inputs.control]")
    delivery.write(project=delivery.texts["project"][:start])
    table = delivery.table(delivery.control(), "control_points")
    assert len(table) == 0
    assert list(table.columns)[:4] == ["point", *XYZ]


def test_heights_above_a_geoid_become_ellipsoidal(delivery, test_data):
    grid = test_data / "ign_borea_uce_m3" / "fr_ign_RAF20.tif"
    delivery.change("project", '"EPSG:32632"', '"EPSG:2154"')
    delivery.write(control="point,x,y,z\nC1,521565.58,6459960.99,200\n")
    row = delivery.table(
        delivery.control(f'inputs.control.heights={{geoid="{grid}"}}'), "control_points"
    ).iloc[0]
    frame = MapFrame.of("EPSG:2154", Heights(geoid=grid))
    latitude, longitude, height = frame.to_geodetic(np.array([[521565.58, 6459960.99, 200.0]]))[0]
    np.testing.assert_allclose(row["z_m"], height, atol=1e-9)
    np.testing.assert_allclose(
        height - 200.0, frame.geoid_undulation(np.array([latitude]), np.array([longitude]))[0], atol=1e-9
    )


def test_a_point_outside_the_geoid_grid_names_the_grid(delivery, test_data):
    grid = test_data / "ign_borea_uce_m3" / "fr_ign_RAF20.tif"
    with pytest.raises(InputError) as raised:
        delivery.change("control", "5300150", "6000150").control(f'inputs.control.heights={{geoid="{grid}"}}')
    assert "fr_ign_RAF20.tif" in raised.value.what
    assert raised.value.entity == "C1"


def test_a_missing_geoid_grid_is_an_error_with_its_key_and_line(delivery):
    delivery.change(
        "project",
        'csv"\ncrs = "EPSG:32632"\nheights = "ellipsoidal"\nposition',
        'csv"\ncrs = "EPSG:32632"\nheights = { geoid = "missing.tif" }\nposition',
    )
    with pytest.raises(InputError) as raised:
        delivery.project()
    assert raised.value.entity == "inputs.exposures.heights.geoid"
    assert raised.value.file == delivery.project_file
    lines = delivery.texts["project"].splitlines()
    assert "missing.tif" in lines[raised.value.line - 1]


def test_a_file_that_is_no_geoid_grid_is_an_error(delivery):
    (delivery.folder / "grid.tif").write_bytes(b"not a grid")
    with pytest.raises(InputError, match="cannot be read"):
        delivery.control('inputs.control.heights={geoid="grid.tif"}')


CALIFORNIA = MapFrame.of("EPSG:26941", ELLIPSOIDAL)
# The origin of zone 1 in plan: false easting and northing are 2,000,000 m and 500,000 m.
IN_FEET = "6561666.6666667 1640416.6666667 1000.0"


def listed(tmp_path, crs, row=IN_FEET, **declared):
    """Table and remarks of a list of OpenDroneMap that states this CRS."""
    file = tmp_path / "gcp_list.txt"
    file.write_text(f"{crs}\n{row} 10 20 a.tif G1\n")
    given = {"file": str(file), "format": "odm-gcp", "crs": "EPSG:26941", "heights": "ellipsoidal"}
    source = ControlInput.model_validate({**given, "sigma_m": 0.02, **declared})
    columns, _, notes = control_columns([source], CALIFORNIA)
    return [float(columns[name][0]) for name in XYZ], notes.problems


@pytest.mark.parametrize(
    "crs",
    [
        "EPSG:2225",
        "+proj=lcc +lat_0=39.3333333333333 +lon_0=-122 "
        "+lat_1=41.6666666666667 +lat_2=40 +x_0=2000000 +y_0=500000 +datum=NAD83 +units=us-ft",
    ],
)
def test_a_file_that_states_a_crs_in_feet_is_read_in_the_metric_one(tmp_path, crs):
    place, _ = listed(tmp_path, crs, length_unit="us-ft")
    np.testing.assert_allclose(place, [2e6, 5e5, 1000 * 1200 / 3937], rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("crs", "declared", "what", "remedy"),
    [
        ("EPSG:2225", {}, "US survey foot", 'length_unit = "us-ft"'),
        # 4 m in two million.
        ("EPSG:2225", {"length_unit": "ft"}, "US survey foot", 'length_unit = "us-ft"'),
        ("EPSG:26941", {"length_unit": "us-ft"}, "in metre", 'length_unit = "m"'),
        ("EPSG:2225+6360", {"length_unit": "us-ft", "height_unit": "m"}, "NAVD88", 'height_unit = "us-ft"'),
        ("EPSG:2226", {"length_unit": "us-ft"}, "another projection", "metric CRS of the same zone"),
    ],
)
def test_a_unit_that_the_crs_of_a_file_contradicts_is_refused(tmp_path, crs, declared, what, remedy):
    with pytest.raises(InputError) as raised:
        listed(tmp_path, crs, **declared)
    assert what in raised.value.what
    assert remedy in raised.value.remedy


def test_heights_above_the_sea_that_are_declared_ellipsoidal_are_said(tmp_path):
    row = "2000000.0 500000.0 300.0"
    assert not any("NAVD88" in one for one in listed(tmp_path, "EPSG:26941", row)[1])
    (said,) = (one for one in listed(tmp_path, "EPSG:26941+5703", row)[1] if "NAVD88" in one)
    assert "gcp_list.txt states heights of NAVD88 height; they are taken as ellipsoidal" in said
