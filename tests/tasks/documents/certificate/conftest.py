"""A calibration with its results: 28 images, a radial error, control and check points, a check."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from flows.stories.aerial_triangulation import adjusted_block
from flows.stories.block_preparation import prepare_block
from tasks.calibration.record import CalibratedParameter, CalibrationRecord
from tasks.documents.certificate.compose import content_of
from tasks.documents.certificate.content import CertificateContent
from tasks.documents.certificate.material import CertificateMaterial, read_certificate_material
from tasks.results.summary import summary_of
from tasks.settings.camera_identity import CameraIdentity
from tasks.settings.load import load_project
from tasks.settings.load_simulation import load_simulation
from tasks.settings.project import Project
from tasks.simulation.simulate import simulate_project
from tasks.stages.direct_georeferencing import check_georeferencing
from tasks.store.notes import read_notes
from tasks.store.store import Outputs, Store
from tasks.tables.parquet import read_table
from tests.tasks.documents.certificate.calibrations import record_of, written

#: Names as a delivery may have them: nothing of them may become HTML or typst markup.
HOSTILE = '<b>B&1</b> "q" #panic("x") $x^2$ *bold* _i_ @ref \\ [a] {{ 7*7 }}'
CHANGES = ("points.count=700", "truth.image_errors.radial_um=3.0", "control.check_fraction=0.4")
OVERRIDES = (
    'adjustment.free=["boresight","gnss_shift","gnss_strip_bias","principal_point"]',
    'adjustment.self_calibration.parameters="bluh:1-2+9-11"',
    "direct_georeferencing.calibration=adjustment",
    "gates.rmse_control_m.max=[0.10, 0.10, 0.15]",
)


@dataclass(frozen=True)
class Calibration:
    """The stages of a calibration and its record."""

    folder: Path
    project: Project
    store: Store
    stages: tuple[Outputs, ...]
    read: CertificateMaterial

    @property
    def record(self) -> CalibrationRecord:
        """Its record."""
        return self.read.record

    def table(self, name: str) -> pd.DataFrame:
        """A table of the results."""
        outputs = {key: artifact for one in self.stages for key, artifact in one.items()}
        return read_table(outputs[name])

    def material(self, record: CalibrationRecord | None = None) -> CertificateMaterial:
        """The material of a certificate, of another record where one is given."""
        return self.read if record is None else replace(self.read, record=record)

    def content(self, record: CalibrationRecord | None = None) -> CertificateContent:
        """What the certificate says."""
        return self._own_content if record is None else content_of(self.material(record), {"typst": "1"})

    @cached_property
    def _own_content(self) -> CertificateContent:
        return content_of(self.read, {"typst": "1"})


@pytest.fixture(scope="session")
def calibration(tmp_path_factory: pytest.TempPathFactory) -> Calibration:
    folder = tmp_path_factory.mktemp("certified")
    simulate_project(load_simulation("uce-high", CHANGES), folder)
    project = load_project(folder / "project.toml", OVERRIDES)
    store = Store.of(folder / "results")
    block = prepare_block(project, store)
    adjusted = adjusted_block(project, store, block)
    checked = check_georeferencing(
        store,
        exposures=block.exposures["exposures"],
        cameras=block.exposures["cameras"],
        image_points=block.image_points["image_points"],
        control_points=block.control["control_points"],
        project=project.project,
        direct=project.direct_georeferencing,
        adjustment=project.adjustment,
        checks=project.checks,
        parameters=adjusted["parameters"],
        correlations=adjusted["correlations"],
        control_residuals=adjusted["control_residuals"],
        residual_grid=adjusted["residual_grid"],
    )
    stages = (*block.stages, adjusted, checked)
    summary = summary_of([read_notes(one["notes"]) for one in stages], project.gates, {})
    assert summary.sigma0 is not None
    assert summary.redundancy is not None
    tables = {name: artifact for one in stages for name, artifact in one.items()}
    record = record_of(tables, project, summary.sigma0, int(summary.redundancy))
    identity = CameraIdentity(body="UC-E-1", lens="L-80", imu="IMU-7", mount="D-CERT hatch 1")
    camera = record.camera.model_copy(update={"identity": identity})
    artifact = written(changed(record, camera=camera), folder)
    read = read_certificate_material(artifact, stages, project, project.certificate, project.source)
    return Calibration(folder, project, store, stages, read)


def changed(record: CalibrationRecord, **changes: object) -> CalibrationRecord:
    """The record with other parts."""
    content = {name: getattr(record, name) for name in type(record).model_fields}
    return CalibrationRecord.model_validate({**content, **changes})


def with_parameter(
    record: CalibrationRecord, name: str, change: Callable[[CalibratedParameter], CalibratedParameter]
) -> CalibrationRecord:
    """The record with one parameter changed; one that loses its σ loses its place in the covariance."""
    parameters = tuple(change(item) if item.parameter == name else item for item in record.parameters)
    kept = [
        index
        for index, item in enumerate(record.estimated)
        if next(p for p in parameters if p.key == item.key).sigma is not None
    ]
    covariance = tuple(tuple(record.covariance[i][j] for j in kept) for i in kept)
    undetermined = [item for item in parameters if item.verdict in ("weak", "not_determinable")]
    verdict = {"verdict": "refused", "reasons": ("Not determined.",)} if undetermined else {}
    return changed(record, parameters=parameters, covariance=covariance, **verdict)


def tables_of(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The tables of certificate.json by name."""
    blocks = [block for section in document["sections"] for block in section["blocks"]]
    blocks += [each for block in blocks for each in block.get("blocks", [])]
    return {block["name"]: block for block in blocks if block["kind"] == "table"}


def number_in(table: dict[str, Any], row: str, column: str) -> float | None:
    """The full value of a cell of a table of certificate.json."""
    place = [each["name"] for each in table["columns"]].index(column)
    (cells,) = [each["cells"] for each in table["rows"] if each["key"] == row]
    value = cells[place]["value"]
    assert value is None or isinstance(value, float)
    return value


def text_in(table: dict[str, Any], row: str, column: str) -> str:
    """The text of a cell of a table of certificate.json."""
    place = [each["name"] for each in table["columns"]].index(column)
    (cells,) = [each["cells"] for each in table["rows"] if each["key"] == row]
    assert isinstance(cells[place], str)
    return cells[place]


def as_json(document: object) -> dict[str, Any]:
    """A document as a program reads it."""
    read = json.loads(json.dumps(document, allow_nan=False))
    assert isinstance(read, dict)
    return read
