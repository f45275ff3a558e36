from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.settings.load import load_project

REPOSITORY = Path(__file__).resolve().parents[3]
PROJECT = """\
version = 1
[project]
name = "p"
crs = "EPSG:2154"
heights = "ellipsoidal"

[cameras."CAM 1"]
columns = 100
rows = 80
pixel_um = 5.0
focal_length_mm = 100.0
principal_point_mm = [0, 0]
pixel_origin = "centre"
mount_deg = 180

[[inputs.image_points]]
file = "a.csv"
format = "csv"
unit = "px"

[[inputs.image_points]]
file = "b.csv"
format = "csv"
unit = "mm"
sigma = [0.001, 0.002]

[inputs.exposures]
file = "${DELIVERY}/e.csv"
format = "csv"
crs = "EPSG:2154"
heights = "ellipsoidal"
position = "imu"
angles = { order = "omega-phi-kappa", unit = "gon", reference = "grid" }
sigma.position_m = 0.1

[adjustment]
free = ["boresight"]
rejection = { critical_value = 3.29 }
priors = { boresight_deg = 0.1, principal_point_mm = 0.05 }

[gates]
sigma0 = { max = 1.2 }
rmse_check_m = { max = [0.1, 0.1, 0.2] }
"""


@pytest.fixture
def write(tmp_path):
    (tmp_path / "delivery").mkdir()
    for name in ("a.csv", "b.csv", "delivery/e.csv"):
        (tmp_path / name).write_text("x\n")

    def write_project(text=PROJECT):
        path = tmp_path / "project.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write_project


def load(path, *overrides, **options):
    return load_project(path, overrides, environment={"DELIVERY": str(path.parent / "delivery")}, **options)


def refused(path, *overrides, **options):
    with pytest.raises(InputError) as raised:
        load(path, *overrides, **options)
    return raised.value


def line_of(text, part):
    return next(number for number, line in enumerate(text.splitlines(), 1) if part in line)


def test_a_project_is_read_with_defaults_tuples_and_absolute_paths(write, tmp_path):
    project = load(write())
    assert project.cameras["CAM 1"].mount_deg == 180
    assert [source.file for source in project.inputs.image_points] == [tmp_path / "a.csv", tmp_path / "b.csv"]
    assert project.inputs.image_points[1].sigma == (0.001, 0.002)
    assert project.inputs.exposures[0].sigma.position_m == (0.1, 0.1, 0.1)
    assert project.inputs.exposures[0].sigma.attitude_deg == (0.003, 0.003, 0.008)
    assert project.inputs.control == ()
    assert project.adjustment.priors.boresight_deg == (0.1, 0.1, 0.1)
    assert project.adjustment.priors.lever_arm_m is None
    assert project.adjustment.max_iterations == 20
    assert project.gates.sigma0.max == 1.2
    assert project.gates.rmse_control_m is None


def test_rejection_and_heights_are_a_word_or_a_table(write):
    assert load(write()).adjustment.rejection.critical_value == 3.29
    assert load(write(), "adjustment.rejection=none").adjustment.rejection.critical_value is None
    assert (
        load(write(PROJECT.replace("rejection", "# rejection"))).adjustment.rejection.critical_value == 4.13
    )


@pytest.mark.parametrize(
    ("old", "new", "entity", "fits"),
    [
        ("pixel_um", "pixel_mm", "cameras.CAM 1.pixel_mm", "pixel_um"),
        ("[adjustment]", "[adjustmnt]", "adjustmnt", "adjustment"),
        ("critical_value", "critical", "adjustment.rejection.critical", "critical_value"),
        ("position =", "postion =", "inputs.exposures.postion", "position"),
        ("order =", "ordr =", "inputs.exposures.angles.ordr", "order"),
        ('unit = "mm"', 'units = "mm"', "inputs.image_points.1.units", "unit"),
    ],
)
def test_an_unknown_key_names_the_nearest_one_with_its_line(write, old, new, entity, fits):
    text = PROJECT.replace(old, new)
    error = refused(write(text))
    assert error.entity == entity
    assert f"'{fits}'" in error.remedy
    assert error.line == line_of(text, new)


@pytest.mark.parametrize(
    ("removed", "entity"),
    [
        ('crs = "EPSG:2154"\nheights = "ellipsoidal"\nposition', "inputs.exposures.crs"),
        ("mount_deg = 180\n", "cameras.CAM 1.mount_deg"),
        ('pixel_origin = "centre"\n', "cameras.CAM 1.pixel_origin"),
        ("version = 1\n", "version"),
        ('unit = "px"\n', "inputs.image_points.0.unit"),
    ],
)
def test_what_must_be_declared_has_no_default(write, removed, entity):
    replacement = 'heights = "ellipsoidal"\nposition' if "position" in removed else ""
    error = refused(write(PROJECT.replace(removed, replacement)))
    assert error.entity == entity
    assert error.remedy.startswith("Add it: ")


def test_invalid_toml_names_its_line(write):
    error = refused(write(PROJECT.replace('name = "p"', "name = p")))
    assert error.line == 3
    assert "TOML" in error.what


def test_a_project_file_that_is_not_there_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="no such project file"):
        load_project(tmp_path / "none.toml")


def test_a_folder_in_the_place_of_a_project_file_names_the_one_in_it(write, tmp_path):
    name = write().name
    with pytest.raises(
        InputError, match=rf"This is a folder, not a project file\. Name the file in it: {name}\."
    ):
        load_project(tmp_path)


def test_a_project_file_that_is_not_utf8_is_an_input_error(tmp_path):
    path = tmp_path / "project.toml"
    path.write_bytes('name = "Mühle"'.encode("latin-1"))
    with pytest.raises(InputError, match="UTF-8"):
        load_project(path)


def test_a_byte_order_mark_does_not_matter(write):
    assert load(write("\ufeff" + PROJECT)).version == 1


def test_a_missing_file_names_key_line_and_place(write, tmp_path):
    (tmp_path / "b.csv").unlink()
    error = refused(write())
    assert error.entity == "inputs.image_points.1.file"
    assert error.line == line_of(PROJECT, "b.csv")
    assert str(tmp_path / "b.csv") in error.what


def test_a_variable_that_is_not_set_is_named(write):
    with pytest.raises(InputError, match="variable DELIVERY is not set") as raised:
        load_project(write(), environment={})
    assert raised.value.line == line_of(PROJECT, "${DELIVERY}")


def test_the_data_folder_is_searched_when_a_file_is_not_beside_the_project(write, tmp_path):
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    (tmp_path / "b.csv").rename(moved / "b.csv")
    assert load(write(), data=moved).inputs.image_points[1].file == moved / "b.csv"


def test_the_data_folder_stands_in_for_the_test_data_variable(write, tmp_path):
    path = write(PROJECT.replace("${DELIVERY}", "${AEROCAL_TEST_DATA}"))
    project = load_project(path, data=tmp_path / "delivery", environment={})
    assert project.inputs.exposures[0].file == tmp_path / "delivery" / "e.csv"


def test_a_deployment_reads_only_under_its_roots(write, tmp_path):
    assert load(write(), roots=[tmp_path]).version == 1
    error = refused(write(), roots=[tmp_path / "delivery"])
    assert "may read" in error.what
    assert error.entity == "inputs.image_points.0.file"


def test_a_way_out_of_the_roots_through_a_link_is_noticed(write, tmp_path, tmp_path_factory):
    outside = tmp_path_factory.mktemp("outside") / "secret.csv"
    outside.write_text("x\n")
    (tmp_path / "a.csv").unlink()
    (tmp_path / "a.csv").symlink_to(outside)
    assert "may read" in refused(write(), roots=[tmp_path]).what


def test_set_replaces_values_of_every_kind(write):
    project = load(
        write(),
        "project.name=a b",
        "adjustment.max_iterations=7",
        'adjustment.free=["boresight", "lever_arm"]',
        "inputs.image_points.1.sigma=0.003",
        'cameras."CAM 1".mount_deg=90',
        "inputs.exposures.sigma.attitude_deg=[0.1, 0.2, 0.3]",
        "adjustment.rejection.critical_value=5",
        "checks.min_intersection_angle_deg=2",
    )
    assert project.project.name == "a b"
    assert project.adjustment.max_iterations == 7
    assert project.adjustment.free == ("boresight", "lever_arm")
    assert project.inputs.image_points[1].sigma == (0.003, 0.003)
    assert project.cameras["CAM 1"].mount_deg == 90
    assert project.inputs.exposures[0].sigma.attitude_deg == (0.1, 0.2, 0.3)
    assert project.adjustment.rejection.critical_value == 5.0
    assert project.checks.min_intersection_angle_deg == 2.0


@pytest.mark.parametrize(
    ("override", "part"),
    [
        ("adjustment.max_iteration=7", "Did you mean 'max_iterations'?"),
        ("cameras.CAM2.mount_deg=90", "Did you mean 'CAM 1'?"),
        ("inputs.image_points.7.sigma=1", "not one of them"),
        ("adjustment.max_iterations", "has no value"),
        ("a b=1", "not a key"),
        ("project.name.first=x", "no key 'first'"),
    ],
)
def test_set_takes_only_keys_that_exist(write, override, part):
    assert part in str(refused(write(), override))


@pytest.mark.parametrize(
    ("override", "part"),
    [
        ("adjustment.max_iterations=0", "greater than or equal to 1"),
        ('adjustment.free=["focal"]', "'focal_length'"),
        ('adjustment.free=["boresight", "boresight"]', "named twice"),
        ("inputs.exposures.sigma.position_m=-0.1", "greater than 0"),
        ("inputs.exposures.heights=orthometric", "ellipsoidal"),
        ("inputs.exposures.position=nadir", "projection_centre"),
        ("inputs.exposures.format=ign-opc", "Did you mean 'ign-opk'?"),
        ("adjustment.rejection=some", "critical_value"),
        ("gates.sigma0={}", "no limit"),
        ("gates.sigma0=1.2", "The value 1.2 is not a table. Write { KEY = VALUE } with keys of: min, max."),
        (
            "gates.sigma0={max: 1.2}",
            "not valid TOML: Expected '=' after a key in a key/value pair (at character 5)",
        ),
        ("gates.sigma0={max=1.2", "not valid TOML: Unclosed inline table (at its end)"),
        ("adjustment.free=[boresight]", "not valid TOML: Invalid value (at character 2). Texts in it"),
        ("project.heights={ geoid = raf20.tif }", "not valid TOML: Invalid value (at character 11)"),
        ("project.flown=24.12.2020", 'The value "24.12.2020" is not a day. Write year, month and day'),
        (
            "project.flown=2020-12-24T21:28:42",
            "is not a day. Write year, month and day without a time, such as",
        ),
        ("gates.sigma0=max", 'The value "max" is not a table'),
        ('adjustment.free=["boresite"]', "Did you mean 'boresight'?"),
        ('cameras."CAM 1".file="a.csv"', "Keep only one of the two"),
        ('cameras."CAM 1".mount_deg=45', "0, 90, 180 or 270"),
        ('cameras."CAM 1".reduced_by_m=[0, 0, -1]', 'declare position = "projection_centre"'),
        ("version=2", "Input should be 1"),
        ("project.heights={}", "ellipsoidal"),
        ("project.heights={ linear_alteration = { ground_m = 205.0 } }", "Also give the geoid grid"),
        ("adjustment.residual_grid.method=collocation", "corrects nothing with 0 iterations"),
        ('adjustment.residual_grid={ method = "collocation", iterations = 5, cells = 37 }', "at most 36"),
        (
            'adjustment.residual_grid={ method = "collocation", iterations = 5, file = "project.toml" }',
            "Leave out `file`",
        ),
    ],
)
def test_values_that_cannot_be_are_refused(write, override, part):
    assert part in str(refused(write(), override))


def test_a_wrong_value_is_looked_for_where_it_was_given(write):
    """Not in a line of the file that --set has replaced."""
    error = refused(write(), "adjustment.max_iterations=0")
    assert (error.file, error.line) == (None, None)
    assert str(error).startswith("--set adjustment.max_iterations=0: The value 0 is not allowed here")
    in_file = refused(
        write(PROJECT.replace("pixel_um = 5.0", "pixel_um = -5.0")), "adjustment.max_iterations=9"
    )
    assert in_file.line == line_of(PROJECT, "pixel_um = 5.0")


def test_a_camera_without_file_needs_all_its_values(write):
    error = refused(write(PROJECT.replace("pixel_um = 5.0\n", "").replace("rows = 80\n", "")))
    assert "rows, pixel_um" in error.what
    assert error.line == line_of(PROJECT, '[cameras."CAM 1"]')


@pytest.mark.parametrize("example", ["ign_ultracam_eagle", "ign_borea"])
def test_the_examples_are_valid(example, test_data):
    path = REPOSITORY / "examples" / example / "project.toml"
    project = load_project(path, environment={"AEROCAL_TEST_DATA": str(test_data)})
    assert project.inputs.control


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("pixel_um = 5.0", f"pixel_um = {'9' * 300}", "more than 64 bits"),
        ("pixel_um = 5.0", f"pixel_um = {'9' * 5_000}", "not valid TOML"),
        ("pixel_um = 5.0", f"pixel_um = 0x{'f' * 20_000}", "more than 64 bits"),
        ("pixel_um = 5.0", "pixel_um = nan", "nan is not finite"),
        ("pixel_um = 5.0", "pixel_um = 1e300", "too large"),
        ("pixel_um = 5.0", "pixel_um = 1e-300", "too small"),
        ("pixel_um = 5.0", "pixel_um = 1e-12", "less than 1e-09"),
        ("pixel_um = 5.0", "pixel_um = 1e12", "more than 1e+09"),
        ("rows = 80", "rows = 100000000", "less than or equal to 1000000"),
        ("principal_point_mm = [0, 0]", "principal_point_mm = [0]", "Number 2 of this list is missing"),
    ],
)
def test_a_number_that_no_quantity_has_is_refused_in_its_line_and_not_repeated(write, old, new, part):
    assert PROJECT.count(old) == 1
    error = refused(write(PROJECT.replace(old, new)))
    assert part in str(error)
    assert error.line == line_of(PROJECT, old) or "TOML" in part
    assert len(str(error)) - len(str(error.file)) < 400


def test_a_file_of_more_than_a_megabyte_is_no_project_file(write):
    error = refused(write(PROJECT + "# " + "a" * 1_000_000))
    assert "2 MB, more than the 1 MB" in error.what
    assert "AEROCAL_MAX_SETTINGS_MB" in error.remedy


@pytest.mark.parametrize(
    "deep", ["a" + ".a" * 31 + " = 1", "a = " + "[" * 100_000, "[a" + ".a" * 100_000 + "]"]
)
def test_deep_tables_are_refused_in_their_line(write, deep):
    error = refused(write(PROJECT + deep + "\n"))
    assert "nested too deeply" in error.what
    assert error.line == len(PROJECT.splitlines()) + 1


@pytest.mark.parametrize(
    ("override", "part"),
    [
        ("a" + ".a" * 20_000 + "=1", "too long, or nested too deeply"),
        ("project.name=" + "[" * 50_000, "too long, or nested too deeply"),
        ("project.name=" + "x" * 200_000, "too long, or nested too deeply"),
        ("project.name=" + "x" * 50_000, "characters, more than 4096"),
        ('cameras."CAM 1".columns=' + "9" * 5_000, "characters, more than 4096"),
        ('cameras."CAM 1".columns=0x' + "f" * 3_000, "more than 64 bits"),
        ("project.name=\x1b[31m", "invisible character"),
        ("project.name=a\nversion=2", "invisible character"),
        ("a\nversion=2", "not a key"),
        ("=1", "not a key"),
        ("inputs.image_points." + "9" * 5_000 + ".unit=px", "not one of them"),
        ("gates.sigma0.min=nan", "not finite"),
        ("gates.sigma0={min=2, max=1}", "No value passes a gate whose min 2 is more than its max 1"),
        ("inputs.control.file=" + "x" * 300, "There is no file"),
        ("inputs.control.file=~nobody-of-this-name/x", "no user"),
    ],
)
def test_an_option_that_cannot_be_is_refused_and_not_repeated(write, override, part):
    error = str(refused(write(), override))
    assert part in error
    assert len(error) < 1_500


@pytest.mark.parametrize("name", ["x" * 300 + ".toml", "x/" * 3_000])
def test_a_project_file_of_an_impossible_name_is_not_there(name):
    with pytest.raises(InputError, match="no such project file"):
        load_project(Path(name))


def test_the_digest_is_of_the_bytes_that_were_read(write):
    path = write()
    before = hashlib.sha256(path.read_bytes()).hexdigest()
    project = load(path)
    path.write_text("other")
    assert project.source is not None
    assert project.source.sha256 == before
