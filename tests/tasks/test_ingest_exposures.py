from __future__ import annotations

import numpy as np
import pytest

from adjust.geometry.rotation import (
    from_omega_phi_kappa,
    from_phi_omega_kappa,
    omega_phi_kappa_jacobian,
    phi_omega_kappa_jacobian,
)
from tasks.coordinates.crs import MapFrame
from tasks.errors import InputError
from tasks.settings.coordinates import ELLIPSOIDAL

OPK = ["omega_deg", "phi_deg", "kappa_deg"]
HPR = ["heading_deg", "pitch_deg", "roll_deg"]
XYZ = ["x_m", "y_m", "z_m"]


def test_exposures_in_the_projects_own_system_keep_every_digit(delivery):
    delivery.change("exposures", "500400,5300100,2001", "500400.123,5300100.4567,2001.9")
    table = delivery.table(delivery.exposures(), "exposures").set_index("image")
    assert table.loc["I2", XYZ].tolist() == [500400.123, 5300100.4567, 2001.9]
    assert table.loc["I3", OPK].tolist() == [-0.3, 0.1, -170.0]
    assert table[HPR].isna().all().all()
    assert table.loc["I1", "position"] == "antenna"


def test_defaults_of_sigma_are_those_of_the_input_and_rows_beat_them(delivery):
    delivery.write(
        exposures="image,camera,strip,x,y,z,omega,phi,kappa,sx,sy,sz,somega,sphi,skappa\n"
        "I1,CAM,S,500000,5300000,2000,0,0,0,0.01,0.02,0.03,0.001,0.002,0.004\n"
        "I2,CAM,S,500000,5300000,2000,0,0,0,,,,,,\n"
    )
    table = delivery.table(delivery.exposures("inputs.exposures.sigma.position_m=0.2"), "exposures")
    sigma = table[
        ["sigma_x_m", "sigma_y_m", "sigma_z_m", "sigma_omega_deg", "sigma_phi_deg", "sigma_kappa_deg"]
    ]
    np.testing.assert_allclose(
        sigma, [[0.01, 0.02, 0.03, 0.001, 0.002, 0.004], [0.2, 0.2, 0.2, 0.003, 0.003, 0.008]]
    )


def test_phi_omega_kappa_in_gon_becomes_the_same_rotation_in_omega_phi_kappa(delivery):
    delivery.change("project", '"omega-phi-kappa", unit = "deg"', '"phi-omega-kappa", unit = "gon"')
    delivery.change("exposures", "0.1,-0.2,10", "3.5,-2.25,110")
    table = delivery.table(delivery.exposures(), "exposures").set_index("image")
    given = from_phi_omega_kappa(np.array([3.5, -2.25, 110.0]) * np.pi / 200.0)
    np.testing.assert_allclose(
        from_omega_phi_kappa(np.radians(table.loc["I1", OPK].to_numpy(float))), given, atol=1e-14
    )


def test_sigmas_of_phi_omega_kappa_are_propagated_through_the_small_rotation(delivery):
    delivery.change("project", '"omega-phi-kappa"', '"phi-omega-kappa"')
    delivery.change("exposures", "0.1,-0.2,10", "8,-12,60")
    delivery.change("project", "reference", "reference")
    table = delivery.table(
        delivery.exposures("inputs.exposures.sigma.attitude_deg=[0.01,0.02,0.05]"), "exposures"
    )
    row = table.set_index("image").loc["I1"]
    spread = phi_omega_kappa_jacobian(np.radians([8.0, -12.0, 60.0])) @ np.diag([0.01, 0.02, 0.05])
    back = np.linalg.inv(omega_phi_kappa_jacobian(np.radians(row[OPK].to_numpy(float)))) @ spread
    expected = np.sqrt(np.diag(back @ back.T))
    np.testing.assert_allclose(
        row[["sigma_omega_deg", "sigma_phi_deg", "sigma_kappa_deg"]].to_numpy(float), expected, rtol=1e-12
    )


def test_true_north_kappa_becomes_grid_kappa_by_adding_the_convergence(delivery):
    delivery.change("project", '"grid"', '"true-north"').change(
        "exposures", "500000,5300000", "650000,5300000"
    )
    delivery.change("exposures", "0.1,-0.2,10", "0,0,10")
    table = delivery.table(delivery.exposures(), "exposures").set_index("image")
    frame = MapFrame.of("EPSG:32632", ELLIPSOIDAL)
    gamma = np.degrees(frame.convergence(np.array([[650000.0, 5300000.0, 0.0]])))[0]
    assert 1.4 < gamma < 1.6
    np.testing.assert_allclose(table.loc["I1", "kappa_deg"], 10.0 + gamma, atol=1e-11)


def test_local_reference_is_the_same_as_true_north_on_the_earth(delivery):
    true_north = delivery.table(delivery.change("project", '"grid"', '"true-north"').exposures(), "exposures")
    local = delivery.table(delivery.change("project", '"true-north"', '"local"').exposures(), "exposures")
    np.testing.assert_array_equal(true_north[OPK], local[OPK])


def test_a_delivery_in_the_neighbouring_zone_is_turned_into_the_projects_grid(delivery):
    here, there = MapFrame.of("EPSG:32632", ELLIPSOIDAL), MapFrame.of("EPSG:32633", ELLIPSOIDAL)
    place = np.array([[720000.0, 5300000.0, 2000.0]])
    x, y, z = there.from_geodetic(here.to_geodetic(place))[0]
    delivery.write(
        exposures=f"image,camera,strip,x,y,z,omega,phi,kappa\nI1,CAM,S,{x!r},{y!r},{z!r},0,0,30\n".replace(
            "np.float64(", ""
        ).replace(")", "")
    )
    delivery.change("project", 'format = "csv"\ncrs = "EPSG:32632"', 'format = "csv"\ncrs = "EPSG:32633"')
    row = delivery.table(delivery.exposures(), "exposures").iloc[0]
    np.testing.assert_allclose(row[XYZ].to_numpy(float), place[0], atol=1e-6)
    turn = here.convergence(place)[0] - there.convergence(np.array([[x, y, z]]))[0]
    np.testing.assert_allclose(row["kappa_deg"], 30.0 + np.degrees(turn), atol=1e-9)
    assert abs(np.degrees(turn)) > 4.0


def test_heading_pitch_roll_stay_against_true_north(delivery):
    delivery.write(
        exposures="image,camera,strip,x,y,z,heading,pitch,roll,time\nI1,CAM,S,600000,5300000,2000,87.5,-0.8,1.2,12.5\n"
    )
    delivery.change("project", '"omega-phi-kappa"', '"heading-pitch-roll"').change(
        "project", '"grid"', '"true-north"'
    )
    row = delivery.table(
        delivery.exposures("inputs.exposures.sigma.attitude_deg=[1, 2, 3]"), "exposures"
    ).iloc[0]
    assert row[HPR].tolist() == [87.5, -0.8, 1.2]
    # Sigmas of the input are in the order roll, pitch, heading.
    assert row[["sigma_heading_deg", "sigma_pitch_deg", "sigma_roll_deg"]].tolist() == [3.0, 2.0, 1.0]
    assert row[OPK].isna().all()
    assert row["time_s"] == 12.5


def test_a_heading_against_grid_north_becomes_a_true_one(delivery):
    delivery.write(
        exposures="image,camera,strip,x,y,z,heading,pitch,roll\nI1,CAM,S,650000,5300000,2000,90,0,0\n"
    )
    delivery.change("project", '"omega-phi-kappa"', '"heading-pitch-roll"')
    row = delivery.table(delivery.exposures(), "exposures").iloc[0]
    gamma = MapFrame.of("EPSG:32632", ELLIPSOIDAL).convergence(np.array([[650000.0, 5300000.0, 0.0]]))[0]
    np.testing.assert_allclose(row["heading_deg"], 90.0 + np.degrees(gamma), atol=1e-10)


FLIGHTS = """image,camera,strip,flight,x,y,z,omega,phi,kappa
I1,CAM,S1,low,500000,5300000,2000,0,0,0
I2,CAM,S1,high,500000,5300000,4000,0,0,0
I3,CAM,,high,500100,5300000,4000,0,0,0
I4,CAM,S1,,500200,5300000,4000,0,0,0
"""


def test_parts_of_one_flight_count_as_one_and_keep_their_strips_apart(delivery):
    delivery.write(exposures=FLIGHTS)
    declared = "inputs.exposures.flights={low={part_of='1'}, high={part_of='1'}}"
    table = delivery.table(delivery.exposures(declared), "exposures")
    assert table["flight"].fillna("").tolist() == ["1", "1", "1", ""]
    assert table["strip"].fillna("").tolist() == ["low S1", "high S1", "", "S1"]


def test_a_flight_after_a_remount_has_a_camera_of_its_own(delivery):
    delivery.write(exposures=FLIGHTS)
    own = "inputs.exposures.flights={high={camera='CAM2'}}"
    with pytest.raises(InputError, match="CAM2") as raised:
        delivery.exposures(own)
    assert raised.value.entity == "I2"
    first = delivery.texts["project"].partition("[cameras.CAM]")[2].partition("[inputs")[0]
    delivery.change("project", "[inputs.image_points]", f"[cameras.CAM2]{first}[inputs.image_points]")
    table = delivery.table(delivery.exposures(own), "exposures")
    assert table["camera"].tolist() == ["CAM", "CAM2", "CAM2", "CAM"]
    assert table["strip"].fillna("").tolist() == ["S1", "S1", "", "S1"]


def test_a_declared_flight_that_is_not_there_is_named(delivery):
    delivery.write(exposures=FLIGHTS)
    with pytest.raises(InputError) as raised:
        delivery.exposures("inputs.exposures.flights={hgh={part_of='1'}}")
    assert raised.value.entity == "hgh"
    assert "Its flights are: high, low." in raised.value.remedy


def test_an_image_given_twice_names_both_lines(delivery):
    delivery.change("exposures", "I3,CAM", "I1,CAM")
    with pytest.raises(InputError) as raised:
        delivery.exposures()
    assert (raised.value.line, raised.value.entity) == (4, "'I1'")
    assert "line 2" in raised.value.what


def test_an_unknown_camera_names_the_nearest_one(delivery):
    delivery.change("exposures", "I2,CAM", "I2,CAN")
    with pytest.raises(InputError) as raised:
        delivery.exposures()
    assert raised.value.line == 3
    assert "'CAN'" in raised.value.what
    assert "Did you mean 'CAM'?" in raised.value.remedy


@pytest.mark.parametrize(("unit", "value", "fits"), [("deg", "399.5", "gon"), ("rad", "350.0", "deg")])
def test_angles_beyond_a_full_turn_name_the_unit_that_fits(delivery, unit, value, fits):
    delivery.change("exposures", "-170", value).change("project", 'unit = "deg"', f'unit = "{unit}"')
    with pytest.raises(InputError) as raised:
        delivery.exposures()
    assert (raised.value.line, raised.value.entity) == (4, "I3")
    assert f'angles.unit = "{fits}"' in raised.value.remedy


def test_gon_within_a_full_turn_of_degrees_is_a_suspicion(delivery):
    delivery.change("exposures", "-170", "-190")
    problems = delivery.notes(delivery.exposures()).problems
    assert any("may be gon" in problem for problem in problems)


def test_ordinary_degrees_raise_no_suspicion(delivery):
    assert delivery.notes(delivery.exposures()).problems == ()


def test_positions_outside_the_crs_say_that_x_and_y_look_swapped(delivery):
    text = "image,camera,strip,x,y,z,omega,phi,kappa\nI1,CAM,S,5300000,500000,2000,0,0,0\n"
    delivery.write(exposures=text)
    with pytest.raises(InputError) as raised:
        delivery.exposures()
    assert (raised.value.line, raised.value.entity) == (2, "I1")
    assert "x and y look swapped" in raised.value.remedy


def test_a_table_with_the_sigmas_of_one_coordinate_only_is_said_to_be_incomplete(delivery):
    header = "image,camera,strip,x,y,z,omega,phi,kappa,sx"
    delivery.write(exposures=f"{header}\nI1,CAM,S,500000,5300000,2000,0,0,0,0.1\n")
    (said,) = delivery.notes(delivery.exposures()).problems
    assert said.startswith("exposures.csv: no row has all of its standard deviations; sigma.position_m")


@pytest.mark.parametrize(
    ("x", "y", "remedy"),
    [
        ("32500000", "5300000", "subtract 32,000,000 m"),
        ("9.0", "47.85", "They look like longitude and latitude"),
        ("500000000", "5300000000", "Check the CRS declared for this file, and the units."),
    ],
)
def test_positions_outside_the_crs_say_what_they_look_like(delivery, x: str, y: str, remedy: str) -> None:
    header = "image,camera,strip,x,y,z,omega,phi,kappa"
    delivery.write(exposures=f"{header}\nI1,CAM,S,{x},{y},2000,0,0,0\nI2,CAM,S,{x},{y},2001,0,0,0\n")
    with pytest.raises(InputError) as raised:
        delivery.exposures()
    assert remedy in raised.value.remedy


@pytest.mark.parametrize(("y", "is_map"), [("5300000", True), ("5300", False)])
def test_map_coordinates_that_are_declared_local_are_suspicious(delivery, y: str, is_map: bool) -> None:
    header = "image,camera,strip,x,y,z,omega,phi,kappa"
    delivery.write(exposures=f"{header}\nI1,CAM,S,500000,{y},2000,0,0,0\nI2,CAM,S,502000,{y},2000,0,0,0\n")
    read = delivery.exposures("project.crs=local", "inputs.exposures.crs=local")
    said = [text for text in delivery.notes(read).problems if "Cartesian" in text]
    assert bool(said) is is_map
    if is_map:
        assert "0.08 m over the 2.0 km of the block" in said[0]


def test_positions_of_another_zone_do_not_look_swapped(delivery):
    delivery.change("exposures", "500400,5300100", "500400,-1300100")
    with pytest.raises(InputError) as raised:
        delivery.exposures()
    assert "swapped" not in raised.value.remedy
    assert raised.value.line == 3


def test_results_far_from_the_area_of_their_crs_are_refused(delivery):
    """EPSG:2583 for 25832: a zone of another country, into which PROJ converts the block all the same."""
    with pytest.raises(InputError) as raised:
        delivery.exposures("project.crs=EPSG:2583")
    assert (raised.value.line, raised.value.entity) == (2, "I1")
    assert "outside the area of EPSG:2583, the CRS of the results (3 of 3 rows)" in raised.value.what
    assert "[project]" in raised.value.remedy


def test_geographic_positions_are_east_then_north(delivery):
    frame = MapFrame.of("EPSG:32632", ELLIPSOIDAL)
    latitude, longitude, _ = np.degrees(frame.to_geodetic(np.array([[500400.0, 5300100.0, 0.0]]))[0])
    delivery.write(
        exposures=f"image,camera,strip,x,y,z,omega,phi,kappa\nI1,CAM,S,{longitude},{latitude},2001,0,0,5\n"
    )
    delivery.change("project", 'format = "csv"\ncrs = "EPSG:32632"', 'format = "csv"\ncrs = "EPSG:4326"')
    row = delivery.table(delivery.exposures(), "exposures").iloc[0]
    np.testing.assert_allclose(row[XYZ].to_numpy(float), [500400.0, 5300100.0, 2001.0], atol=1e-6)


def test_results_in_a_geographic_crs_are_refused(delivery):
    with pytest.raises(InputError, match=r"^project\.crs: .*results are in metres"):
        delivery.exposures("project.crs=EPSG:4326")


def test_a_local_project_does_not_mix_with_a_map_projection(delivery):
    with pytest.raises(InputError, match='CRS "local" cannot be combined'):
        delivery.exposures("project.crs=local")


def test_a_local_project_keeps_its_axes(delivery):
    delivery.change("project", '"EPSG:32632"', '"local"')
    table = delivery.table(delivery.exposures(), "exposures").set_index("image")
    assert table.loc["I1", XYZ].tolist() == [500000.0, 5300000.0, 2000.0]
    assert table.loc["I1", OPK].tolist() == [0.1, -0.2, 10.0]


def test_further_columns_are_kept_as_text(delivery):
    delivery.change("exposures", "kappa\n", "kappa,note\n").change("exposures", ",10\n", ",10,007\n")
    delivery.change("exposures", ",11\n", ",11,\n").change("exposures", "-170\n", "-170,windy\n")
    table = delivery.table(delivery.exposures(), "exposures")
    assert table["note"].tolist()[0] == "007"
    assert table["note"].isna().tolist() == [False, True, False]


def test_the_camera_table_holds_certificate_and_mounting(delivery):
    delivery.change("project", "mount_deg = 0", "mount_deg = 90\nlever_arm_m = [0.1, 0.2, -0.3]")
    row = delivery.table(delivery.exposures(), "cameras").iloc[0]
    assert row["camera"] == "CAM"
    assert (row["principal_point_x_mm"], row["principal_point_y_mm"]) == (0.01, -0.02)
    assert row["mount_deg"] == 90
    assert row[["lever_arm_x_m", "lever_arm_y_m", "lever_arm_z_m"]].tolist() == [0.1, 0.2, -0.3]


RATES = """\
image,camera,strip,x,y,z,omega,phi,kappa,rate_roll,rate_pitch,rate_yaw
I1,CAM,S1,500000,5300000,2000,0.1,-0.2,10,1.0,-0.5,0.25
I2,CAM,S1,500400,5300100,2001,0.2,-0.1,11,,,
I3,CAM,S2,500800,5300200,2002,-0.3,0.1,-170,0,0,0
"""
RATE_COLUMNS = ["rate_roll_deg_s", "rate_pitch_deg_s", "rate_yaw_deg_s"]


@pytest.mark.parametrize(
    ("axes", "unit", "expected"),
    [
        ("forward-right-down", "deg", [1.0, -0.5, 0.25]),
        ("forward-left-up", "deg", [1.0, 0.5, -0.25]),
        ("forward-right-down", "gon", [0.9, -0.45, 0.225]),
    ],
)
def test_rates_are_about_the_declared_axes_in_the_unit_of_the_angles(delivery, axes, unit, expected):
    delivery.write(exposures=RATES)
    overrides = (f"inputs.exposures.angles.rate_axes={axes}", f"inputs.exposures.angles.unit={unit}")
    table = delivery.table(delivery.exposures(*overrides), "exposures").set_index("image")
    np.testing.assert_allclose(table.loc["I1", RATE_COLUMNS].to_numpy(np.float64), expected, rtol=1e-12)
    assert table.loc["I2", RATE_COLUMNS].isna().all()


def test_rates_whose_axes_are_not_declared_are_an_error_and_so_are_declared_ones_that_are_missing(delivery):
    axes = "inputs.exposures.angles.rate_axes=forward-left-up"
    with pytest.raises(InputError, match="the file contains no rates"):
        delivery.exposures(axes)
    delivery.write(exposures=RATES)
    with pytest.raises(InputError, match="their axes are not declared"):
        delivery.exposures()
    delivery.write(exposures=RATES.replace("1.0,-0.5,0.25", "1.0,,0.25"))
    with pytest.raises(InputError, match="'rate_pitch' is empty here"):
        delivery.exposures(axes)
