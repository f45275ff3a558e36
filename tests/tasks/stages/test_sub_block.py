"""The inputs of a scenario: images of a sub-block, and roles of the surveyed points."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tasks.coordinates.crs import MapFrame
from tasks.errors import InputError
from tasks.settings.coordinates import ELLIPSOIDAL
from tasks.settings.project import ProjectSettings
from tasks.settings.sweep import BlockSelection, ControlScenario
from tasks.stages.sub_block import assign_roles, select_images
from tasks.store.artifact import Artifact, artifact_of
from tasks.store.store import Store
from tasks.sweep.control_choice import control_chosen
from tasks.tables.parquet import read_table, write_table
from tasks.tables.schemas.columns import TableSchema
from tasks.tables.schemas.deliveries import CONTROL_POINTS, IMAGE_POINTS, IMAGES

PROJECT = ProjectSettings(name="field", crs="local", heights=ELLIPSOIDAL)


def surveyed_grid(columns: int, rows: int) -> pd.DataFrame:
    """Control points on a grid of 100 m, named by column and row."""
    names = [f"{x}-{y}" for x in range(columns) for y in range(rows)]
    place = 100.0 * np.array([(x, y) for x in range(columns) for y in range(rows)], dtype=np.float64)
    table = pd.DataFrame({"point": names, "x_m": place[:, 0], "y_m": place[:, 1], "z_m": 5.0})
    return table.assign(sigma_x_m=0.02, sigma_y_m=0.02, sigma_z_m=0.02, role="control")


def measured(points: list[str], images: tuple[str, ...] = ("E01_1", "E02_1")) -> pd.DataFrame:
    """Every point in every image."""
    rows = [(image, point) for image in images for point in points]
    table = pd.DataFrame(rows, columns=["image", "point"])
    return table.assign(x_mm=0.0, y_mm=1.0, sigma_x_mm=1e-3, sigma_y_mm=1e-3)


def chosen(scenario: ControlScenario, surveyed: pd.DataFrame, points: pd.DataFrame | None = None) -> set[str]:
    seen = measured(list(surveyed["point"])) if points is None else points
    return set(surveyed["point"][control_chosen(scenario, "s", surveyed, seen)])


def written(folder: Path, schema: TableSchema, table: pd.DataFrame) -> Artifact:
    folder.mkdir(exist_ok=True)
    path = folder / f"{schema.name}.parquet"
    columns = {
        column.name: table[column.name].to_numpy() for column in schema.columns if column.name in table
    }
    frame = MapFrame.of("local", ELLIPSOIDAL) if schema.coordinates else None
    write_table(path, schema, columns, frame)
    return artifact_of(path)


def test_four_even_points_are_the_corners_and_the_fifth_the_middle() -> None:
    field = surveyed_grid(5, 3)
    corners = {"0-0", "0-2", "4-0", "4-2"}
    assert chosen(ControlScenario(count=4), field) == corners
    assert chosen(ControlScenario(count=5), field) == corners | {"2-1"}


@pytest.mark.parametrize(("columns", "rows"), [(2, 2), (3, 2), (2, 5), (4, 3), (6, 6)])
def test_fewer_even_points_are_a_part_of_more_and_their_number_is_as_asked(columns: int, rows: int) -> None:
    field = surveyed_grid(columns, rows)
    numbers = range(1, columns * rows + 1)
    found = [chosen(ControlScenario(count=number), field) for number in numbers]
    assert [len(one) for one in found] == list(numbers)
    assert all(fewer < more for fewer, more in pairwise(found))


def test_points_along_the_border_leave_the_inside_to_the_check_points() -> None:
    field = surveyed_grid(5, 5)
    border = chosen(ControlScenario(count=8, layout="border"), field)
    assert border == {"0-0", "2-0", "4-0", "4-2", "4-4", "2-4", "0-4", "0-2"}
    whole = chosen(ControlScenario(count=16, layout="border"), field)
    assert all("0" in name or "4" in name for name in whole)
    assert len(whole) == 16


def test_only_points_fully_surveyed_and_measured_twice_are_counted() -> None:
    field = surveyed_grid(2, 2)
    field.loc[0, "x_m"] = field.loc[0, "y_m"] = np.nan
    once = measured(list(field["point"])).query("not (point == '1-1' and image == 'E02_1')")
    assert chosen(ControlScenario(count=2), field, once) == {"0-1", "1-0"}
    with pytest.raises(InputError, match="only 2 points are fully surveyed") as raised:
        chosen(ControlScenario(count=3), field, once)
    assert raised.value.entity == "sweep.control.s"


def test_roles_as_delivered_all_and_by_name() -> None:
    field = surveyed_grid(2, 2)
    field.loc[1, "role"] = "check"
    assert chosen(ControlScenario(roles="delivered"), field) == {"0-0", "1-0", "1-1"}
    assert len(chosen(ControlScenario(roles="all"), field)) == 4
    assert chosen(ControlScenario(points=("0-1",)), field) == {"0-1"}
    assert chosen(ControlScenario(points=()), field) == set()
    with pytest.raises(InputError, match="no surveyed point '0-7'"):
        chosen(ControlScenario(points=("0-7",)), field)


def test_the_table_of_a_scenario_has_its_roles_and_the_coordinates_untouched(tmp_path: Path) -> None:
    field = surveyed_grid(3, 2).sample(frac=1.0, random_state=4)
    control = written(tmp_path / "in", CONTROL_POINTS, field)
    points = written(tmp_path / "in", IMAGE_POINTS, measured(list(field["point"])))
    outputs = assign_roles(
        Store.of(tmp_path / "out"),
        control_points=control,
        image_points=points,
        control=ControlScenario(points=("0-0", "2-1")),
        name="two",
        project=PROJECT,
    )
    table, before = read_table(outputs["control_points"]), read_table(control)
    assert set(table.loc[table["role"] == "control", "point"]) == {"0-0", "2-1"}
    assert set(table["role"]) == {"control", "check"}
    pd.testing.assert_frame_equal(table.drop(columns="role"), before.drop(columns="role"))


@pytest.fixture
def block(tmp_path: Path) -> dict[str, Artifact]:
    images = pd.DataFrame(
        {
            "image": ["E01_1", "E02_1", "N01_1", "H01_1"],
            "camera": "C",
            "strip": ["E01", "E02", "N01", "H01"],
            "flight": ["low", "low", "low", "high"],
            "heading_deg": [90.0, 270.0, 0.0, 90.0],
            "height_above_ground_m": [700.0, 710.0, 705.0, 2300.0],
            "status": "used",
        }
    )
    return {
        "images": written(tmp_path / "in", IMAGES, images),
        "image_points": written(tmp_path / "in", IMAGE_POINTS, measured(["a", "b"], tuple(images["image"]))),
    }


@pytest.mark.parametrize(
    ("selection", "images"),
    [
        ({}, {"E01_1", "E02_1", "N01_1", "H01_1"}),
        ({"flights": ("low",)}, {"E01_1", "E02_1", "N01_1"}),
        ({"strips": ("E*", "H01")}, {"E01_1", "E02_1", "H01_1"}),
        ({"strips": ("?01",), "flights": ("low",)}, {"E01_1", "N01_1"}),
        ({"height_m": (701.0, 3000.0)}, {"E02_1", "N01_1", "H01_1"}),
        # Of low E01, E02, N01 the first and the third; of high its only one.
        ({"every_strip": 2}, {"E01_1", "N01_1", "H01_1"}),
        ({"strips": ("E*",), "every_strip": 2}, {"E01_1"}),
        ({"every_image": 2}, {"E01_1", "E02_1", "N01_1", "H01_1"}),
    ],
)
def test_a_sub_block_has_the_points_of_its_images_only(
    tmp_path: Path, block: dict[str, Artifact], selection: dict[str, object], images: set[str]
) -> None:
    chosen_block = BlockSelection.model_validate(selection)
    outputs = select_images(Store.of(tmp_path / "out"), **block, block=chosen_block, name="part")
    points = read_table(outputs["image_points"])
    assert set(points["image"]) == images
    assert len(points) == 2 * len(images)


def test_every_third_image_of_every_second_strip_is_kept(tmp_path: Path) -> None:
    names = [f"{strip}_{number:02d}" for strip in ("E01", "E02", "E03") for number in range(1, 8)]
    images = pd.DataFrame(
        {
            "image": names,
            "camera": "C",
            "strip": [name[:3] for name in names],
            "flight": "low",
            "heading_deg": 90.0,
            "height_above_ground_m": 700.0,
            "status": "used",
        }
    )
    outputs = select_images(
        Store.of(tmp_path / "out"),
        images=written(tmp_path / "in", IMAGES, images),
        image_points=written(tmp_path / "in", IMAGE_POINTS, measured(["a"], tuple(names))),
        block=BlockSelection(every_strip=2, every_image=3),
        name="thinned",
    )
    kept = set(read_table(outputs["image_points"])["image"])
    assert kept == {f"{strip}_{number:02d}" for strip in ("E01", "E03") for number in (1, 4, 7)}


@pytest.mark.parametrize(
    ("selection", "words"),
    [
        ({"flights": ("lwo",)}, "Did you mean 'low'?"),
        ({"strips": ("X*",)}, "no strip 'X*'"),
        ({"height_m": (1.0, 2.0)}, "No image belongs to this sub-block."),
    ],
)
def test_a_sub_block_that_cannot_be_is_refused_by_name(
    tmp_path: Path, block: dict[str, Artifact], selection: dict[str, object], words: str
) -> None:
    with pytest.raises(InputError) as raised:
        select_images(
            Store.of(tmp_path / "out"), **block, block=BlockSelection.model_validate(selection), name="part"
        )
    assert words in str(raised.value)
    assert raised.value.entity == "sweep.blocks.part"
