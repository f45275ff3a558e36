"""What the project file declares beside a file: camera, flight and strips, and what the file says itself."""

from __future__ import annotations

import shutil

import numpy as np
import pandas as pd
import pytest

from tasks.errors import InputError

HEAD = "image,time,x,y,z,omega,phi,kappa"
ROW = "500000,5300000,2000,0.1,-0.2,10"
POSEO = """
format = "applanix"
crs = "EPSG:26916"
heights = "ellipsoidal"
position = "projection_centre"
camera = "CAM"
"""


def table_of(delivery, rows, *overrides):
    delivery.write(exposures="\n".join([HEAD, *(f"{name},{time},{ROW}" for name, time in rows)]) + "\n")
    made = delivery.exposures('inputs.exposures.camera="CAM"', *overrides)
    return delivery.table(made, "exposures").set_index("image")


def test_strips_end_where_time_has_gaps(delivery):
    rows = [("d", 130.0), ("a", 10.0), ("b", 14.0), ("c", 18.5), ("e", 134.0), ("f", 400.0), ("g", 404.0)]
    table = table_of(delivery, rows, 'inputs.exposures.strip="time-gaps"')
    assert table["strip"].to_dict() == dict(zip("abcdefg", "1112233", strict=True))
    assert (table["camera"] == "CAM").all()


@pytest.mark.parametrize("later", [0.0, 2e-5])
def test_heads_that_expose_together_make_no_strips(delivery, later):
    heads = (("L", 0.0), ("R", later))
    rows = [(f"{head}{k}", 4.0 * k + after) for head, after in heads for k in range(5)]
    rows += [(f"{head}9", 100.0 + after) for head, after in heads]
    table = table_of(delivery, rows, 'inputs.exposures.strip="time-gaps"')
    assert set(table.loc[["L9", "R9"], "strip"]) == {"2"}
    assert set(table.drop(["L9", "R9"])["strip"]) == {"1"}


def test_strips_and_flights_are_found_in_names(delivery):
    rows = [("3324c_2015_1004_05_0182_RGB", 1), ("3324c_2016_1004_06_0251_RGB", 2)]
    rule = 'inputs.exposures.strip={pattern="*_{flight}_*_{strip}_*"}'
    table = table_of(delivery, rows, rule)
    assert table["strip"].tolist() == ["05", "06"]
    assert table["flight"].tolist() == ["2015", "2016"]
    table = table_of(
        delivery, rows, 'inputs.exposures.strip={pattern="?????_{strip}_*"}', 'inputs.exposures.flight="F"'
    )
    assert table["strip"].tolist() == ["2015", "2016"]
    assert table["flight"].tolist() == ["F", "F"]


@pytest.mark.parametrize(
    ("rows", "rule", "said"),
    [
        ([("a", ""), ("b", 2)], '"time-gaps"', "has no time"),
        ([("a_1", 1), ("b", 2)], '{pattern="{strip}_*"}', "does not match the pattern"),
        ([("a", 1)], '"names"', "is not valid"),
        ([("a", 1)], '{pattern="{strip}*"}', "does not define where"),
        ([("a", 1)], '{pattern="*_*"}', "needs {strip} once"),
        ([("a", 1)], "{gap_factor=0.5}", "each image is a strip"),
        ([("a", 1)], '{gap_factor=3.0, pattern="{strip}_*"}', "one rule"),
    ],
)
def test_rules_that_do_not_fit_are_refused(delivery, rows, rule, said):
    with pytest.raises(InputError) as raised:
        table_of(delivery, rows, f"inputs.exposures.strip={rule}")
    assert said in str(raised.value)


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ('inputs.exposures.decimal=","', "A comma cannot be both"),
        ("inputs.exposures.header=false", "known by their numbers"),
    ],
)
def test_layouts_that_cannot_be_are_refused(delivery, override, said):
    with pytest.raises(InputError) as raised:
        delivery.exposures(override)
    assert said in str(raised.value)


def test_a_layout_is_refused_where_the_format_has_its_own(delivery):
    with pytest.raises(InputError, match="the format of this file has its own"):
        delivery.exposures('inputs.exposures.format="patb"', 'inputs.exposures.separator="tab"')


@pytest.fixture
def poseo(delivery, test_data):
    shutil.copy(test_data / "format_samples" / "applanix_eo" / "applanix_utm_eo_example.txt", delivery.folder)
    text = delivery.texts["project"].replace("EPSG:32632", "EPSG:26916")
    begin, end = text.index("[inputs.exposures]"), text.index("angles = ")
    exposures = '[inputs.exposures]\nfile = "applanix_utm_eo_example.txt"' + POSEO
    return delivery.write(project=text[:begin] + exposures + text[end:])


def test_the_published_applanix_file_becomes_exposures(poseo):
    made = poseo.exposures('inputs.exposures.strip="time-gaps"')
    table = poseo.table(made, "exposures")
    # The first line has eight images; the gaps between lines are minutes, within them 7 s.
    counts = table.groupby("strip", sort=False).size()
    assert counts.iloc[0] == 8
    assert counts.sum() == 72
    np.testing.assert_array_equal(
        table.loc[0, ["x_m", "y_m", "z_m"]].to_numpy(float), [470696.886, 5155353.811, 1997.734]
    )
    assert "Kappa cardinal rotation" in " ".join(poseo.notes(made).problems)


@pytest.mark.parametrize(
    ("override", "remedy"),
    [
        ('inputs.exposures.crs="EPSG:26917"', 'crs = "EPSG:'),
        ('inputs.exposures.crs="EPSG:32616"', "Declare the CRS of the file"),
        ('inputs.exposures.position="antenna"', 'position = "projection_centre"'),
        ('inputs.exposures.angles.reference="true-north"', 'angles.reference = "grid"'),
        ('inputs.exposures.angles.order="phi-omega-kappa"', 'angles.order = "omega-phi-kappa"'),
        ('inputs.exposures.angles.unit="gon"', 'angles.unit = "deg"'),
    ],
)
def test_what_the_file_says_must_be_declared(poseo, override, remedy):
    with pytest.raises(InputError) as raised:
        poseo.exposures(override)
    assert remedy in raised.value.remedy


def test_one_delivery_in_other_formats_gives_the_same_tables(delivery):
    """The delivery of all tests, with semicolons, decimal commas, PATB image points and numbered images."""
    sound = {
        "exposures": delivery.table(delivery.exposures(), "exposures"),
        "image_points": delivery.table(delivery.image_points(control=True), "image_points"),
        "control_points": delivery.table(delivery.control(), "control_points"),
    }
    head, *rows = delivery.texts["exposures"].strip().split("\n")
    heads = {"image": "Bild", "x": "Rechts", "y": "Hoch", "z": "Höhe"}
    changed = [";".join(heads.get(name, name) for name in head.split(","))]
    changed += [row.replace(",", ";").replace(".", ",") for row in rows]
    points = [row.split(",") for row in delivery.texts["points"].strip().split("\n")[1:]]
    lists = [
        "\n".join([f"{k} CAM", *(f" {p} {x} {y} 1" for image, p, x, y in points if image == f"I{k}"), "-99"])
        for k in (1, 2, 3)
    ]
    control = delivery.texts["control"].replace("point,x,y,z", "Name,Easting,Northing,H").replace(",", "\t")
    project = delivery.texts["project"]
    columns = 'columns = { image = "Bild", x = "Rechts", y = "Hoch", z = "Höhe" }'
    layout = f'separator = "semicolon"\ndecimal = ","\n{columns}\n'
    project = project.replace("[inputs.control]", f"{layout}[inputs.control]").replace(
        'file = "points.csv"\nformat = "csv"',
        'file = "points.csv"\nformat = "patb"\nimage_names = "names.csv"',
    )
    project += 'separator = "tab"\ncolumns = { point = "Name", x = "Easting", y = "Northing", z = "H" }\n'
    (delivery.folder / "names.csv").write_text("photo,image\n1,I1\n2,I2\n3,I3\n")
    delivery.write(project=project, exposures="\n".join(changed), points="\n".join(lists), control=control)
    again = {
        "exposures": delivery.table(delivery.exposures(), "exposures"),
        "image_points": delivery.table(delivery.image_points(control=True), "image_points"),
        "control_points": delivery.table(delivery.control(), "control_points"),
    }
    for name, table in sound.items():
        key = ["image", "point"] if name == "image_points" else table.columns[0]
        pd.testing.assert_frame_equal(
            again[name].sort_values(key, ignore_index=True), table.sort_values(key, ignore_index=True)
        )


def test_a_table_of_names_must_have_every_image_once(delivery):
    (delivery.folder / "names.csv").write_text("photo,image\nI1,a\nI2,b\n")
    with pytest.raises(InputError, match=r"I3: The table of names, names\.csv, does not have this image"):
        delivery.exposures('inputs.exposures.image_names="names.csv"')
    (delivery.folder / "names.csv").write_text("photo,image\nI1,a\nI2,b\nI3,a\n")
    with pytest.raises(InputError, match=r"names\.csv:4: a: The name is in two lines"):
        delivery.exposures('inputs.exposures.image_names="names.csv"')
