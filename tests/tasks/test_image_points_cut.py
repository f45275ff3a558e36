"""A file of image points that ends early at the end of a line is remarked on where the cut can be seen."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project
from tasks.stages.ingest import import_exposures, import_image_points
from tasks.store.notes import read_notes
from tasks.store.store import Store


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two crossing blocks of 28 images with some 4,000 image points."""
    simulation = load_simulation("uce-high", ("points.count=900", "points.detection=0.6"), 1)
    return simulate_project(simulation, tmp_path_factory.mktemp("flight")).project_file


def remarks(project_file: Path, out: Path, rows: pd.DataFrame, *overrides: str) -> list[str]:
    """What the import of the image points says of their file ending early, with these rows delivered."""
    project = load_project(project_file, overrides)
    (source,) = project.inputs.image_points
    delivered = out.with_suffix(".csv")
    rows.to_csv(delivered, index=False)
    read = import_exposures(
        Store.of(out), sources=project.inputs.exposures, cameras=project.cameras, project=project.project
    )
    outputs = import_image_points(
        Store.of(out),
        sources=(source.model_copy(update={"file": delivered}),),
        exposures=read["exposures"],
        cameras=read["cameras"],
        orient_without_exposure=project.inputs.orient_without_exposure,
    )
    return [sentence for sentence in read_notes(outputs["notes"]).problems if "may be incomplete" in sentence]


def test_half_a_file_is_remarked_on_where_its_points_go_by_image_or_place(
    flight: Path, tmp_path: Path
) -> None:
    file = flight.parent / "image_points.csv"
    whole = pd.read_csv(file, dtype=str)
    truth = pd.read_parquet(flight.parent / "truth" / "object_points.parquet").set_index("point")
    assert remarks(flight, tmp_path / "whole", whole) == []
    by_image = whole.sort_values("image", kind="stable")
    by_place = whole.assign(y_m=whole["point"].map(truth["y_m"])).sort_values("y_m", kind="stable")
    for name, rows in (("image", by_image), ("place", by_place.drop(columns="y_m"))):
        half = rows.iloc[: len(rows) // 2]
        (sentence,) = remarks(flight, tmp_path / name, half)
        assert "pairs of neighbouring images share hardly any image point" in sentence
        alone = remarks(flight, tmp_path / f"{name}-orient", half, "inputs.images_without_exposure=orient")
        assert alone == [sentence]


def test_fewer_points_everywhere_are_no_cut(flight: Path, tmp_path: Path) -> None:
    file = flight.parent / "image_points.csv"
    whole = pd.read_csv(file, dtype=str)
    points = whole["point"].drop_duplicates().sample(frac=0.5, random_state=1)
    assert remarks(flight, tmp_path / "thin", whole[whole["point"].isin(points)]) == []
