"""A small delivery in text files, to be damaged by the tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
import pytest

from tasks.settings.load import load_project
from tasks.settings.project import Project
from tasks.stages.ingest import import_control, import_exposures, import_image_points
from tasks.store.notes import Notes, read_notes
from tasks.store.store import Outputs, Store
from tasks.tables.parquet import read_table

PROJECT = """\
version = 1
[project]
name = "small"
crs = "EPSG:32632"
heights = "ellipsoidal"
[cameras.CAM]
columns = 10000
rows = 8000
pixel_um = 5.0
focal_length_mm = 100.0
principal_point_mm = [0.01, -0.02]
pixel_origin = "corner"
mount_deg = 0
[inputs.image_points]
file = "points.csv"
format = "csv"
unit = "mm"
[inputs.exposures]
file = "exposures.csv"
format = "csv"
crs = "EPSG:32632"
heights = "ellipsoidal"
position = "antenna"
angles = { order = "omega-phi-kappa", unit = "deg", reference = "grid" }
[inputs.control]
file = "control.csv"
format = "csv"
crs = "EPSG:32632"
heights = "ellipsoidal"
"""
EXPOSURES = """\
image,camera,strip,x,y,z,omega,phi,kappa
I1,CAM,S1,500000,5300000,2000,0.1,-0.2,10
I2,CAM,S1,500400,5300100,2001,0.2,-0.1,11
I3,CAM,S2,500800,5300200,2002,-0.3,0.1,-170
"""
POINTS = """\
image,point,x,y
I1,P1,10.5,-3.25
I2,P1,-9.5,-3.5
I1,P2,24.9,19.9
I2,P2,4,19
I3,P2,-16,18
I3,C1,1,2
I2,C1,20,3
I1,lonely,0,0
"""
CONTROL = """\
point,x,y,z
C1,500600,5300150,450.5
C2,500100,5300050,440
"""


@dataclass
class Delivery:
    """Files of a project in one folder, and the import stages run on them."""

    folder: Path
    texts: dict[str, str] = field(default_factory=dict)

    @property
    def project_file(self) -> Path:
        return self.folder / "project.toml"

    def write(self, **texts: str) -> Delivery:
        """Replace files: project, exposures, points, control."""
        for name, text in texts.items():
            suffix = "toml" if name == "project" else "csv"
            (self.folder / f"{name}.{suffix}").write_text(text, encoding="utf-8")
            self.texts[name] = text
        return self

    def change(self, name: str, old: str, new: str) -> Delivery:
        """Replace a part of one file that stands in it exactly once or in every line alike."""
        assert old in self.texts[name]
        return self.write(**{name: self.texts[name].replace(old, new)})

    def project(self, *overrides: str) -> Project:
        return load_project(self.project_file, overrides)

    @property
    def store(self) -> Store:
        return Store.of(self.folder / "results")

    def exposures(self, *overrides: str) -> Outputs:
        project = self.project(*overrides)
        return import_exposures(
            self.store, sources=project.inputs.exposures, cameras=project.cameras, project=project.project
        )

    def image_points(self, *overrides: str, control: bool = False) -> Outputs:
        read = self.exposures(*overrides)
        return import_image_points(
            self.store,
            sources=self.project(*overrides).inputs.image_points,
            exposures=read["exposures"],
            cameras=read["cameras"],
            control_points=self.control(*overrides)["control_points"] if control else None,
            outside_format_share=self.project(*overrides).checks.outside_format_share,
        )

    def control(self, *overrides: str) -> Outputs:
        project = self.project(*overrides)
        return import_control(self.store, sources=project.inputs.control, project=project.project)

    @staticmethod
    def table(outputs: Mapping[str, object], name: str) -> pd.DataFrame:
        return read_table(outputs[name])  # type: ignore[arg-type]

    @staticmethod
    def notes(outputs: Mapping[str, object]) -> Notes:
        return read_notes(outputs["notes"])  # type: ignore[arg-type]


@pytest.fixture
def delivery(tmp_path: Path) -> Delivery:
    """A sound delivery of three images, three tie points and two control points."""
    return Delivery(tmp_path).write(project=PROJECT, exposures=EXPOSURES, points=POINTS, control=CONTROL)
