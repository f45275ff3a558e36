"""What a result shows at a keyboard agrees with its arrays."""

from __future__ import annotations

import sys
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from adjust import AdjustmentOptions, AdjustmentResult, MissingExtraError, UnknownNameError, adjust_block
from adjust.parameters import BORESIGHT, FAMILIES, INTERIOR_ORIENTATION
from adjust.result import ObservationStatus
from tests.adjust.scenes import two_strips


@pytest.fixture(scope="module")
def result() -> AdjustmentResult:
    scene = two_strips(cameras=2, free={BORESIGHT: True}, noise_seed=3)
    return adjust_block(scene.block, scene.observations, AdjustmentOptions(critical_value=2.5))


class Cells(HTMLParser):
    """Texts of the cells of a page, and whether every tag is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:  # noqa: ARG002
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def test_one_line_says_what_was_adjusted_and_how_well(result: AdjustmentResult) -> None:
    test = result.test
    verdict = "within" if test.lower <= test.sigma0 <= test.upper else "outside"
    rejected = sum(group.rejected for group in result.groups)
    assert repr(result) == (
        f"<AdjustmentResult: images 10, object points {int(result.active_point.sum())}, "
        "estimated system parameters 6, "
        f"σ0 {test.sigma0:.3f} ({verdict} {test.lower:.3f} … {test.upper:.3f}), "
        f"redundancy {test.redundancy:,}, rejected observations {rejected}, "
        f"iterations {sum(map(len, result.iterations))}>"
    )
    assert repr(result.groups[0]).startswith("<GroupResult of image_points: ")
    assert repr(result.block).endswith("object points; free: boresight>")


def test_the_page_of_a_notebook_has_every_group_and_every_parameter(result: AdjustmentResult) -> None:
    cells = Cells()
    cells.feed(result._repr_html_())
    assert cells.open == []
    for group in result.groups:
        assert group.group.name in cells.texts
    for name in FAMILIES[BORESIGHT].components:
        assert cells.texts.count(name) == 2


def test_names_in_the_page_cannot_be_markup(result: AdjustmentResult) -> None:
    camera = replace(result.block.cameras[0], name="<script>x</script>")
    family = next(item for item in result.layout.system if item.family.name == BORESIGHT)
    system = (replace(family, entities=(camera.name, "across")),)
    hostile = replace(result, layout=replace(result.layout, system=system))
    assert "<script>" not in hostile._repr_html_()


def test_the_table_of_parameters_has_values_with_their_sigma(result: AdjustmentResult) -> None:
    found = result.to_dataframe()
    np.testing.assert_array_equal(found["value"], result.state.system[BORESIGHT].ravel())
    np.testing.assert_allclose(found["sigma"], result.covariance(parameters=["boresight"]).sigma, rtol=1e-9)
    assert list(found["unit"]) == ["rad"] * 6
    assert list(found["entity"]) == ["forward"] * 3 + ["across"] * 3


def test_the_tables_of_images_and_points_have_a_row_for_each(result: AdjustmentResult) -> None:
    images, points = result.to_dataframe("images"), result.to_dataframe("points")
    assert tuple(images["image"]) == result.block.images
    np.testing.assert_allclose(
        images.loc[3].to_numpy()[4:].astype(float), result.covariance(images=["image_03"]).sigma, rtol=1e-9
    )
    assert tuple(points["point"]) == result.block.points
    np.testing.assert_array_equal(points["x"].isna(), ~result.active_point)


def test_the_table_of_observations_has_the_statistics_of_every_component(result: AdjustmentResult) -> None:
    found = result.to_dataframe("observations")
    assert found["redundancy"].sum() == pytest.approx(result.test.redundancy, abs=1e-6)
    used = found[found["status"] == "used"]
    assert float(((used["residual"] / used["sigma"]) ** 2).sum()) == pytest.approx(
        result.test.weighted_squares, rel=0.02
    )  # correlated control apart
    rejected = (result.groups[0].status == ObservationStatus.REJECTED).any(axis=1)
    first = found[found["group"] == "image_points"].iloc[::2]
    np.testing.assert_array_equal(first["status"].to_numpy() == "rejected", rejected)
    assert found[found["group"] == "control_points"]["image"].isna().all()


def test_a_table_that_does_not_exist_is_named_with_those_that_do(result: AdjustmentResult) -> None:
    with pytest.raises(UnknownNameError, match=r"no table 'point'\. Did you mean 'points'"):
        result.to_dataframe("point")  # type: ignore[arg-type]


def test_the_picture_shows_every_exposure_and_point(result: AdjustmentResult) -> None:
    points, images, rejected = result.plot().data
    assert len(points.x) == int(result.active_point.sum())
    np.testing.assert_array_equal(images.x, result.state.projection_centre[:, 0])
    assert len(rejected.x) > 0


def test_a_picture_without_plotly_names_the_extra(
    result: AdjustmentResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "plotly.graph_objects", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'aerocal\[plot\]'"):
        result.plot()


def test_a_family_that_is_not_there_is_said_with_those_that_are(result: AdjustmentResult) -> None:
    with pytest.raises(KeyError) as raised:
        result.state.system["boresigth"]
    assert str(raised.value).startswith(
        "There is no family of system parameters 'boresigth'. Did you mean 'bore"
    )
    with pytest.raises(KeyError, match="There are: interior_orientation, "):
        result.state.system["kappa"]


def test_families_that_are_not_given_are_held_at_what_the_cameras_state() -> None:
    scene = two_strips(free={BORESIGHT: True}, noise_seed=3)
    full = adjust_block(scene.block, scene.observations)
    # The held families of this scene have true values other than zero.
    kept = tuple(
        item for item in scene.block.system if item.family.name not in (INTERIOR_ORIENTATION, "gnss_shift")
    )
    block = replace(scene.block, system=kept)
    assert {item.family.name for item in block.system} == {item.family.name for item in scene.block.system}
    short = adjust_block(block, scene.observations)
    np.testing.assert_array_equal(short.state.system[BORESIGHT], full.state.system[BORESIGHT])
    np.testing.assert_array_equal(short.state.projection_centre, full.state.projection_centre)
