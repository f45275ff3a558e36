"""The report of a very large block stays small."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tasks.coordinates.crs import MapFrame
from tasks.deliveries.cameras import write_cameras
from tasks.documents.report.material import read_material
from tasks.documents.report.page import render
from tasks.settings.coordinates import Heights
from tasks.settings.load import load_project
from tasks.settings.project import Project
from tasks.store.artifact import Artifact, artifact_of
from tasks.store.notes import Notes, write_notes
from tasks.tables.parquet import write_table
from tasks.tables.schemas.adjustment import (
    CHECK_POINTS,
    CONTROL_RESIDUALS,
    DISTANCE_RESIDUALS,
    EXTERIOR_ORIENTATIONS,
    OBJECT_POINTS,
    RESIDUALS,
)
from tasks.tables.schemas.deliveries import CONTROL_POINTS, IMAGE_POINTS, IMAGES
from tasks.tables.schemas.model_tests import MODEL_ALTERNATIVES
from tasks.tables.schemas.parameters import CORRELATIONS, PARAMETERS
from tasks.tables.schemas.residual_grid import RESIDUAL_AUTOCORRELATION, RESIDUAL_GRID
from tests.conftest import PROJECT
from tests.tasks.documents.report.page_reader import Page

STRIPS, IN_STRIP = 36, 68
POINTS, RAYS = 188_000, 545_000
#: Daily so many times smaller: lists are cut all the same.
FEWER = 10
CONTROL = 400
LOCAL = MapFrame("local", Heights.model_validate("ellipsoidal"))
#: What the page may have.
MOST_MEGABYTES = 10.0


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("project")
    for name in ("image_points.csv", "exposures.csv"):
        (folder / name).write_text("")
    (folder / "project.toml").write_text(PROJECT)
    return load_project(folder / "project.toml")


@pytest.fixture(scope="module", params=[FEWER, pytest.param(1, marks=pytest.mark.slow)])
def stages(
    tmp_path_factory: pytest.TempPathFactory, project: Project, request: pytest.FixtureRequest
) -> list[dict[str, Artifact]]:
    """Tables of a large block filled at random: only their form is that of an adjustment."""
    folder = tmp_path_factory.mktemp("tables")
    fewer: int = request.param
    random = np.random.default_rng(1)
    named = [f"strip{s:02d}_{i:05d}" for s in range(STRIPS) for i in range(IN_STRIP // fewer)]
    images = np.array(named, dtype=object)
    points = np.array([f"tie_point_{k:07d}" for k in range(POINTS // fewer)], dtype=object)
    write_cameras(folder / "cameras.parquet", project.cameras)
    _write_images(folder, random, images)
    _write_points(folder, random, points)
    _write_rays(folder, random, images, points, RAYS // fewer)
    _write_surveyed(folder, random, points)
    nothing: dict[str, list[object]] = {column.name: [] for column in DISTANCE_RESIDUALS.columns}
    write_table(folder / "distance_residuals.parquet", DISTANCE_RESIDUALS, nothing)
    _write_residual_grid(folder, random)
    _write_parameters(folder, random)
    _write_model_alternatives(folder, random)
    figures = {"sigma0": 1.0, "redundancy": 5e5, "counts": {"images": len(images)}}
    write_notes(folder, Notes(("A problem of a large block.",), figures))
    return [{path.stem: artifact_of(path) for path in folder.iterdir()}]


def _xyz(values: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{axis}_m": values[:, k] for k, axis in enumerate("xyz")}


def _sigmas(
    random: np.random.Generator, count: int, names: tuple[str, ...], unit: str
) -> dict[str, np.ndarray]:
    return {f"sigma_{name}_{unit}": random.uniform(0.005, 0.05, count) for name in names}


def _write_images(folder: Path, random: np.random.Generator, images: np.ndarray) -> None:
    count = len(images)
    strip, place = np.divmod(np.arange(count), count // STRIPS)
    centres = np.column_stack([place * 400.0, strip * 430.0, np.full(count, 1200.0)])
    centres += random.normal(0, 5, centres.shape)
    angles = {f"{name}_deg": random.normal(0, 1, count) for name in ("omega", "phi", "kappa")}
    write_table(
        folder / "images.parquet",
        IMAGES,
        {
            "image": images,
            "camera": ["C"] * count,
            "strip": [f"strip{s:02d}" for s in strip],
            "heading_deg": 90.0 + 180.0 * (strip % 2),
            "height_above_ground_m": np.full(count, 1150.0),
            "status": ["used"] * count,
        },
    )
    write_table(
        folder / "exterior_orientations.parquet",
        EXTERIOR_ORIENTATIONS,
        {
            "image": images,
            **_xyz(centres),
            **angles,
            **_sigmas(random, count, ("x", "y", "z"), "m"),
            **_sigmas(random, count, ("omega", "phi", "kappa"), "deg"),
        },
        LOCAL,
    )


def _write_points(folder: Path, random: np.random.Generator, points: np.ndarray) -> None:
    place = random.uniform([0, 0, 0], [IN_STRIP * 400.0, STRIPS * 430.0, 80.0], (len(points), 3))
    write_table(
        folder / "object_points.parquet",
        OBJECT_POINTS,
        {
            "point": points,
            **_xyz(place),
            **_sigmas(random, len(points), ("x", "y", "z"), "m"),
            "rays": random.integers(2, 10, len(points)),
        },
        LOCAL,
    )


def _write_rays(
    folder: Path, random: np.random.Generator, images: np.ndarray, points: np.ndarray, rays: int
) -> None:
    pairs = np.unique(random.integers(0, len(images) * len(points), rays + 2000))
    pairs = random.permutation(pairs)[:rays]
    image, point = images[pairs // len(points)], points[pairs % len(points)]
    xy = random.uniform([-0.25, -0.2], [0.25, 0.2], (rays, 2))
    write_table(
        folder / "image_points.parquet",
        IMAGE_POINTS,
        {
            "image": image,
            "point": point,
            "x_mm": xy[:, 0],
            "y_mm": xy[:, 1],
            "sigma_x_mm": np.full(rays, 1e-3),
            "sigma_y_mm": np.full(rays, 1e-3),
        },
    )
    status = random.choice(["used", "rejected", "uncontrolled"], rays, p=[0.85, 0.05, 0.1])
    residual = random.normal(0, 0.9, 2 * rays)
    write_table(
        folder / "residuals.parquet",
        RESIDUALS,
        {
            "group": ["image_points"] * (2 * rays),
            "image": np.concatenate([image, image]),
            "point": np.concatenate([point, point]),
            "component": ["x"] * rays + ["y"] * rays,
            "residual": residual,
            "sigma": np.ones(2 * rays),
            "unit": ["um"] * (2 * rays),
            "redundancy": np.full(2 * rays, 0.5),
            "standardized": residual / 0.7,
            "mdb": np.full(2 * rays, 6.0),
            "external": np.full(2 * rays, 3.0),
            "status": np.concatenate([status, status]),
        },
    )


def _write_surveyed(folder: Path, random: np.random.Generator, points: np.ndarray) -> None:
    named = points[:CONTROL]
    write_table(
        folder / "control_points.parquet",
        CONTROL_POINTS,
        {
            "point": named,
            **_xyz(random.uniform(0, 15_000, (CONTROL, 3))),
            **_sigmas(random, CONTROL, ("x", "y", "z"), "m"),
            "role": ["control", "check"] * (CONTROL // 2),
        },
        LOCAL,
    )
    for schema, start in ((CONTROL_RESIDUALS, 0), (CHECK_POINTS, 1)):
        own = named[start::2]
        differences = {f"{axis}_m": random.normal(0, 0.02, len(own)) for axis in ("dx", "dy", "dz")}
        write_table(
            folder / f"{schema.name}.parquet",
            schema,
            {
                "point": own,
                **differences,
                **_sigmas(random, len(own), ("dx", "dy", "dz"), "m"),
                "rays": np.full(len(own), 5),
                **({"status": ["used"] * len(own)} if start == 0 else {}),
            },
        )


def _write_residual_grid(folder: Path, random: np.random.Generator) -> None:
    column, row = (part.ravel() for part in np.meshgrid(np.arange(25), np.arange(25)))
    write_table(
        folder / "residual_grid.parquet",
        RESIDUAL_GRID,
        {
            "camera": ["C"] * 625,
            "column": column,
            "row": row,
            "x_mm": (column - 12.0) * 0.02,
            "y_mm": (row - 12.0) * 0.016,
            "width_mm": np.full(625, 0.02),
            "height_mm": np.full(625, 0.016),
            **{name: np.zeros(625, dtype=int) for name in ("tile_x", "tile_y")},
            **{name: np.full(625, 800) for name in ("count", "count_vx", "count_vy")},
            **{f"mean_v{axis}_um": random.normal(0, 0.2, 625) for axis in "xy"},
            "significant": random.uniform(size=625) < 0.5,
        },
    )
    distances = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
    write_table(
        folder / "residual_autocorrelation.parquet",
        RESIDUAL_AUTOCORRELATION,
        {
            "camera": ["C"] * 12,
            "component": ["x"] * 6 + ["y"] * 6,
            "distance_to_mm": np.tile(distances, 2),
            "distance_from_mm": np.tile([0.0, *distances[:-1]], 2),
            "pairs": np.full(12, 10**9),
            "correlation": random.uniform(-0.1, 0.3, 12),
            "correlated": random.uniform(size=12) < 0.5,
        },
    )


def _write_parameters(folder: Path, random: np.random.Generator) -> None:
    """Three biases for each strip: more parameters than a matrix or a table should show."""
    names = [(f"gnss_strip_bias_{axis}", f"strip{s:02d}") for s in range(STRIPS) for axis in "xyz"]
    count = len(names)
    write_table(
        folder / "parameters.parquet",
        PARAMETERS,
        {
            "parameter": [name for name, _ in names],
            "entity": [entity for _, entity in names],
            "value": random.normal(0, 0.03, count),
            "change": random.normal(0, 0.03, count),
            "sigma": np.full(count, 0.01),
            "unit": ["m"] * count,
            "t": random.normal(0, 2, count),
            "status": ["significant"] * count,
        },
    )
    first, second = np.triu_indices(count, 1)
    write_table(
        folder / "correlations.parquet",
        CORRELATIONS,
        {
            "parameter_a": [names[k][0] for k in first],
            "entity_a": [names[k][1] for k in first],
            "parameter_b": [names[k][0] for k in second],
            "entity_b": [names[k][1] for k in second],
            "correlation": random.uniform(-1, 1, len(first)),
        },
    )


def _write_model_alternatives(folder: Path, random: np.random.Generator) -> None:
    """Six for each strip."""
    count = 6 * STRIPS
    write_table(
        folder / "model_alternatives.parquet",
        MODEL_ALTERNATIVES,
        {
            "quantity": [f"gnss_shift_{'xyz'[k % 3]}" for k in range(count)],
            "entity": ["camera" if k % 6 < 3 else "" for k in range(count)],
            "scope": ["strip"] * count,
            "part": [f"strip{k // 6:02d}" for k in range(count)],
            "unit": ["m"] * count,
            **{name: random.normal(0, 0.03, count) for name in ("estimate", "explained")},
            **{name: np.full(count, 0.01) for name in ("sigma", "detectable")},
            "t": random.normal(0, 1, count),
            "rank": np.zeros(count, dtype=np.int64),
            "moves": ["gnss_shift_x"] * count,
            "moves_entity": ["1"] * count,
            **{name: np.full(count, 2.0) for name in ("moved_by_detectable", "moved_by_estimate")},
        },
    )


def test_the_report_of_545_000_image_points_is_small(
    stages: list[dict[str, Artifact]], project: Project
) -> None:
    html = render(read_material(stages, project), "large", ("a.csv", "b.csv"), {"aerocal": "0"})
    assert len(html.encode()) < MOST_MEGABYTES * 1e6
    page = Page(html)
    assert page.tables["image-residuals"].numbers["C", "image_points"].shown == f"{_used(stages):,}"
    # What is too long is cut, and the page says where the rest is.
    assert len(page.tables["rejected"].keys) == 60
    assert "all in residuals.parquet" in page.text
    assert len(page.tables["check-points"].keys) == 100
    assert len(page.tables["parameters"].keys) == 80
    assert f"of {3 * STRIPS:,}; all in parameters.parquet" in page.text


def _used(stages: list[dict[str, Artifact]]) -> int:
    residuals = pd.read_parquet(stages[0]["residuals"].path, columns=["component", "status"])
    return int(((residuals["status"] != "rejected") & (residuals["component"] == "x")).sum())
