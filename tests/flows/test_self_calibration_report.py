"""How self-calibration is shown: every number and every vector is that of the artifacts."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.register import AdditionalParameters, additional_parameters
from flows.command.figures import write_figures
from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.documents.report.self_calibration import MOST_ROWS
from tasks.errors import InputError
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tests.tasks.documents.report.page_reader import Page, ReadTable, ends_of_arrows

SELECTION = "bluh:1-4+9-11+42-45"
PIXEL = 5.2e-6
#: UltraCam Eagle, columns along flight: the seams of CCDs of 24 mm × 36 mm that overlap alike.
HALF = np.array([13080, 20010]) * PIXEL / 2
SVG = "{http://www.w3.org/2000/svg}"


@dataclass(frozen=True)
class Calibrated:
    """A run with self-calibration."""

    folder: Path

    @property
    def html(self) -> str:
        return (self.folder / "report.html").read_text(encoding="utf-8")

    @property
    def page(self) -> Page:
        return Page(self.html)

    @property
    def figures(self) -> dict[str, object]:
        found = json.loads((self.folder / "summary.json").read_text())["self_calibration"]
        assert isinstance(found, dict)
        return found

    def table(self, name: str) -> pd.DataFrame:
        return pd.read_parquet(self.folder / f"{name}.parquet")

    def values(self, entity: str) -> pd.Series:
        """Adjusted values of the additional parameters of an entity, by name."""
        table = self.table("parameters")
        own = table[(table["entity"] == entity) & table["parameter"].str.startswith("bluh:")]
        return own.set_index("parameter")["value"]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Calibrated:
    """28 images in two flights, a radial error, and a selection of three parts for each flight."""
    folder = tmp_path_factory.mktemp("shown")
    changes = ('flight.1.flight="2"', "points.count=900", "truth.image_errors.radial_um=3.0")
    simulate_project(load_simulation("uce-high", changes), folder)
    settings = "adjustment.self_calibration"
    overrides = (f'{settings}.parameters="{SELECTION}"', f'{settings}.per="flight"')
    request = RunRequest(folder / "project.toml", overrides=overrides)
    outcome = carry_out(aerial_triangulation, request)
    assert outcome.error is None, outcome.error
    return Calibrated(outcome.directory)


ENTITIES = ("UCE-80 in 1", "UCE-80 in 2")


def model(names: list[str]) -> AdditionalParameters:
    selection = "bluh:" + ",".join(name.removeprefix("bluh:") for name in names)
    return additional_parameters(selection, ImageFormat(float(HALF[0]), float(HALF[1])))


def error_um(values: pd.Series, xy: np.ndarray) -> np.ndarray:
    """−Δ (n, 2) of parameter values at points in metres."""
    return np.asarray(-1e6 * model(list(values.index)).basis(xy) @ values.to_numpy())


def require(table: ReadTable, key: str, expected: dict[str, float]) -> None:
    for column, value in expected.items():
        shown = table.numbers[key, column]
        if value is None or np.isnan(value):
            assert shown.data == "", (key, column)
        else:
            assert float(shown.data) == pytest.approx(value, rel=1e-9, abs=1e-12), (key, column)


def test_the_table_of_parameters_is_that_of_the_artifact(run: Calibrated) -> None:
    offered = run.table("self_calibration")
    shown = run.page.tables["self-calibration"]
    assert len(offered) == 22 < MOST_ROWS
    assert set(shown.keys) == set(offered["parameter"] + "@" + offered["entity"])
    same = ("value", "sigma", "t", "t_of_all", "total_correlation", "strongest_correlation")
    for row in offered.to_dict("records"):
        key = f"{row['parameter']}@{row['entity']}"
        gone = row["decision"] == "is eliminated"
        effects = {name: np.nan if gone else row[name] for name in ("effect_max_um", "effect_rms_um")}
        require(shown, key, {name: row[name] for name in same} | effects)
        texts = shown.texts[key]
        assert texts[2] == row["meaning"]
        assert texts[5] == row["unit"]
        assert ("eliminated: " in texts[9]) == gone
        assert row["reason"].split(" (")[0] in texts[9]
        assert texts[-1] == row["formula"]


def test_parameters_stand_in_the_order_of_their_numbers(run: Calibrated) -> None:
    keys = run.page.tables["self-calibration"].keys
    first = [key for key in keys if key.endswith("in 1")]
    numbers = [int(key.split(":")[1].split("@")[0]) for key in first]
    assert numbers == [1, 2, 3, 4, 9, 10, 11, 42, 43, 44, 45]


def test_tests_of_groups_and_of_flights_are_those_of_the_summary(run: Calibrated) -> None:
    groups, flights = run.figures["groups"], run.figures["flights"]
    assert isinstance(groups, list)
    assert isinstance(flights, list)
    shown = run.page.tables["self-calibration-groups"]
    assert shown.keys == [item["group"] for item in groups] == ["bluh:1–4", "bluh:9–11", "bluh:42–45"]
    columns = ("parameters", "statistic", "critical", "probability")
    for item in groups:
        require(shown, item["group"], {name: float(item[name]) for name in columns})
        words = "contributes" if item["significant"] else "does not differ from zero"
        assert shown.texts[item["group"]][-1] == words
    between = run.page.tables["self-calibration-flights"]
    assert between.keys == [f"{ENTITIES[0]}|{ENTITIES[1]}"]
    require(between, between.keys[0], {name: float(flights[0][name]) for name in columns})


@pytest.mark.parametrize("entity", ENTITIES)
def test_rms_and_largest_errors_are_those_of_the_adjusted_values(run: Calibrated, entity: str) -> None:
    values = run.values(entity)
    shown = run.page.tables["image-errors"]
    axis = np.linspace(-1.0, 1.0, 401)
    xy = np.stack(np.meshgrid(axis * HALF[0], axis * HALF[1]), axis=-1).reshape(-1, 2)
    for title, numbers in (
        ("all", [1, 2, 3, 4, 9, 10, 11, 42, 43, 44, 45]),
        ("bluh:1–4", [1, 2, 3, 4]),
        ("bluh:9–11", [9, 10, 11]),
        ("bluh:42–45", [42, 43, 44, 45]),
    ):
        length = np.hypot(*error_um(values[[f"bluh:{n}" for n in numbers]], xy).T)
        rms, largest = float(np.sqrt(np.mean(length**2))), float(length.max())
        found = {n: float(shown.numbers[f"{title}@{entity}", n].data) for n in ("rms_um", "largest_um")}
        # Another grid: sums over it differ by its step.
        assert found["rms_um"] == pytest.approx(rms, rel=0.02, abs=1e-9)
        assert found["largest_um"] == pytest.approx(largest, rel=0.02, abs=1e-9)
        px = float(shown.numbers[f"{title}@{entity}", "rms_px"].data)
        assert px == pytest.approx(found["rms_um"] / 5.2, rel=1e-12, abs=1e-15)


def arrows(data: str) -> tuple[np.ndarray, np.ndarray]:
    """Tails and vectors (n, 2) of path data, y downwards; arrows too short for a head are left out."""
    found = re.findall(r"M([-\d.]+),([-\d.]+)L([-\d.]+),([-\d.]+)M", data)
    ends = np.array(found, dtype=np.float64)
    return ends[:, :2], ends[:, 2:] - ends[:, :2]


def figure(run: Calibrated, name: str, folder: Path) -> ElementTree.Element:
    write_figures(run.folder, folder)
    return ElementTree.fromstring((folder / f"{name}.svg").read_text(encoding="utf-8"))


@pytest.mark.parametrize(("number", "entity"), list(enumerate(ENTITIES, start=1)))
def test_every_vector_of_the_figure_is_the_systematic_error_at_its_place(
    run: Calibrated, tmp_path: Path, number: int, entity: str
) -> None:
    drawing = figure(run, f"image-errors-{number}", tmp_path)
    frame = next(item for item in drawing.iter(f"{SVG}rect") if item.get("class") == "frame")
    left, top, width, height = (float(frame.get(name) or "nan") for name in ("x", "y", "width", "height"))
    own, scale = [item.get("d") or "" for item in drawing.iter(f"{SVG}path") if item.get("class") == "mean"]
    words = next(text.text for text in drawing.iter(f"{SVG}text") if text.text and " px" in text.text)
    assert words is not None
    per_um = float(arrows(scale)[1][0, 0]) / float(words.split(" µm")[0])
    tails, vectors = arrows(own)
    assert len(tails) > 100
    xy = (tails - [left, top]) / [width, height] * 2.0 - 1.0
    expected = error_um(run.values(entity), xy * [1.0, -1.0] * HALF)
    # Places are rounded to 0.1; beside a seam that is another tile.
    shown = vectors * [1.0, -1.0] / per_um
    apart = np.abs(shown - expected).max(axis=1)
    assert np.quantile(apart, 0.98) < 0.2 / per_um + 0.01
    assert np.hypot(*shown.T).max() > 1.0


def test_borders_of_the_ccd_images_stand_where_the_tiles_meet(run: Calibrated, tmp_path: Path) -> None:
    drawing = figure(run, "image-errors-1", tmp_path)
    frame = next(item for item in drawing.iter(f"{SVG}rect") if item.get("class") == "frame")
    left, width = (float(frame.get(name) or "nan") for name in ("x", "width"))
    seams = next(item for item in drawing.iter(f"{SVG}g") if item.get("class") == "seams")
    upright = [float(line.get("x1") or "nan") for line in seams if line.get("x1") == line.get("x2")]
    # CCDs of 24 mm: three of them over 68.016 mm have their seams at ±(68.016 − 24) / 4 mm.
    expected = [left + width * (0.5 + sign * 11.004 / 68.016) for sign in (-1, 1)]
    assert upright == pytest.approx(expected, abs=0.1)


def test_residuals_without_the_correction_are_those_with_it_plus_the_correction(run: Calibrated) -> None:
    table = run.table("residuals")
    used = table[(table["group"] == "image_points") & table["status"].isin(["used", "uncontrolled"])]
    v = used.pivot_table(index=["image", "point"], columns="component", values="residual").dropna()
    places = run.table("image_points").set_index(["image", "point"]).loc[v.index, ["x_mm", "y_mm"]]
    flight = run.table("images").set_index("image")["flight"].loc[v.index.get_level_values("image")]
    delta = np.zeros((len(v), 2))
    for entity in ENTITIES:
        rows = np.flatnonzero(flight == entity.removeprefix("UCE-80 in "))
        delta[rows] = -error_um(run.values(entity), places.to_numpy()[rows] * 1e-3)
    shown = run.page.tables["self-calibration-residuals"]
    after = v[["x", "y"]].to_numpy()
    for key, residuals in (("after", after), ("before", after + delta)):
        rms = np.sqrt(np.mean(residuals**2, axis=0))
        require(shown, f"{key}@UCE-80", {"rms_x_um": rms[0], "rms_y_um": rms[1]})
    means = [float(shown.numbers[f"{key}@UCE-80", "mean_rms_um"].data) for key in ("before", "after")]
    assert means[1] < 0.7 * means[0]


def test_correlations_of_the_heat_map_are_those_of_the_artifact(run: Calibrated) -> None:
    table = run.table("correlations")
    names = [
        (table[f"parameter_{side}"] + " of " + table[f"entity_{side}"])
        .str.replace("gnss", "GNSS")
        .str.replace("_", " ")
        for side in "ab"
    ]
    expected = {
        (frozenset((one, other)), f"{value:+z.3f}")
        for one, other, value in zip(*names, table["correlation"], strict=True)
    }
    titles = re.findall(r"<title>([^<]*) and ([^<]*): ([+-]\d\.\d{3})</title>", run.html)
    assert len(titles) > 10
    assert {(frozenset((one, other)), value) for one, other, value in titles} == expected


def test_no_arrow_is_cut_at_the_edge_of_its_drawing(run: Calibrated) -> None:
    ends = ends_of_arrows(run.html)
    assert len(ends) > 500
    assert all(0.0 <= part <= 1.0 for place in ends for part in place)


def test_the_page_stays_small(run: Calibrated) -> None:
    assert len(run.html.encode()) < 2_000_000


def test_figures_stand_alone(run: Calibrated, tmp_path: Path) -> None:
    assert write_figures(run.folder, tmp_path / "figures") == 0
    files = sorted((tmp_path / "figures").iterdir())
    names = {file.stem for file in files}
    assert {"image-errors-1", "image-errors-2", "image-error-parts-1", "correlations", "block"} <= names
    assert len(files) == len(re.findall(r"<figure", run.html))
    for file in files:
        drawing = ElementTree.fromstring(file.read_text(encoding="utf-8"))
        assert drawing.tag == f"{SVG}svg"
        assert float(drawing.get("width") or "nan") == 960.0
        style = drawing.find(f"{SVG}style")
        assert style is not None
        assert style.text is not None
        assert ".frame {" in style.text
        assert "var(" not in style.text


def test_a_folder_without_a_report_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no report\.html"):
        write_figures(tmp_path, tmp_path / "figures")
    assert not (tmp_path / "figures").exists()
