"""True north for grid north, 0.04° apart: named where it can be told, else stated as an assumption.

The 20 images of IGN's UltraCam Eagle block, in Lambert's projection with a central meridian close by. The
convergence differs between the strips: attitudes of 0.003° tell which north they have, those stated with 0.5°
do not (as long as nothing estimates their σ).
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pyproj import CRS

from flows.runs.project_run import RunRequest, Story, carry_out
from tasks.calibration.record import CalibrationRecord
from tasks.coordinates.crs import MapFrame
from tasks.settings.coordinates import ELLIPSOIDAL
from tasks.settings.load import load_project
from tasks.stages.ingest import import_exposures
from tasks.store.store import Store
from tasks.tables.parquet import read_table
from tests.flows.calibration_alone import calibration_alone, calibration_with_certificate

PROJECT = Path(__file__).resolve().parents[2] / "examples" / "ign_ultracam_eagle" / "project.toml"
LAMBERT = "EPSG:2154"
COLUMNS = ("image", "camera", "strip", "flight", "x_m", "y_m", "z_m", "omega_deg", "phi_deg", "kappa_deg")


@pytest.fixture(scope="module")
def delivery(test_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Delivery]:
    folder = tmp_path_factory.mktemp("north")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AEROCAL_TEST_DATA", str(test_data))
        place = imported(LAMBERT, folder / "lambert")[["x_m", "y_m", "z_m"]].to_numpy(np.float64)
        longitude = MapFrame.of(LAMBERT, ELLIPSOIDAL).to_geodetic(place)[:, 0].mean()
        crs = about_the_meridian(longitude)
        file = folder / "exposures.csv"
        here = imported(crs, folder / "here")[list(COLUMNS)]
        here.rename(columns=lambda name: name.rsplit("_", 1)[0]).to_csv(file, index=False)
        yield Delivery(folder, crs, file)


def test_the_wrong_north_is_named_first_where_the_convergence_differs(delivery: Delivery) -> None:
    right = delivery.calibrated("grid", 0.003)
    assert not any("other north" in reason for reason in right.reasons)
    assert delivery.assumptions("grid", 0.003) == []
    wrong = delivery.calibrated("true-north", 0.003, calibration_alone)
    assert wrong.reasons[0].startswith("The attitudes appear to refer to the other north: −9")


def test_where_nothing_tells_the_norths_apart_the_effect_is_stated(delivery: Delivery) -> None:
    grid, true = delivery.calibrated("grid", 0.5), delivery.calibrated("true-north", 0.5, calibration_alone)
    assert not any("other north" in reason for record in (grid, true) for reason in record.reasons)
    (row,) = delivery.assumptions("grid", 0.5)
    stated = row["cells"][2]["value"]
    assert stated == pytest.approx(0.0425, abs=1e-4)
    for one, other in zip(grid.parameters, true.parameters, strict=True):
        if one.sigma is not None:
            turned = stated if one.parameter == "boresight_yaw" else 0.0
            assert abs(one.value - other.value) == pytest.approx(turned, abs=0.1 * one.sigma)


@dataclass(frozen=True)
class Delivery:
    """The exposures against the grid of a CRS."""

    folder: Path
    crs: str
    file: Path

    def calibrated(
        self, north: str, sigma: float, story: Story = calibration_with_certificate
    ) -> CalibrationRecord:
        """With attitudes that are said to count from a north and to have a σ, degrees."""
        exposures = (
            f"{{file='{self.file}', format='csv', crs='{self.crs}', heights='ellipsoidal', "
            "position='projection_centre', "
            f"angles={{order='omega-phi-kappa', unit='deg', reference='{north}'}}, "
            f"sigma={{position_m=0.1, attitude_deg={sigma}}}}}"
        )
        changes = (
            f"project.crs='{self.crs}'",
            f"inputs.exposures={exposures}",
            'calibration.free=["boresight"]',
            "calibration.two_step=false",
            "calibration.variance_components=false",
        )
        out = self._out(north, sigma)
        outcome = carry_out(story, RunRequest(PROJECT, out, changes))
        assert outcome.error is None, outcome.error
        return CalibrationRecord.model_validate_json((out / "calibration.json").read_text())

    def assumptions(self, north: str, sigma: float) -> list[dict[str, Any]]:
        """Rows of the certificate's table."""
        sections = json.loads((self._out(north, sigma) / "certificate.json").read_text())["sections"]
        blocks = [block for section in sections for block in section["blocks"]]
        return [row for block in blocks if block.get("name") == "assumptions" for row in block["rows"]]

    def _out(self, north: str, sigma: float) -> Path:
        return self.folder / f"{north} {sigma}"


def about_the_meridian(longitude: float) -> str:
    """Lambert-93 with another central meridian."""
    content = CRS.from_user_input(LAMBERT).to_json_dict()
    for item in content["conversion"]["parameters"]:
        if item["name"] == "Longitude of false origin":
            item["value"] = float(longitude)
    content["conversion"].pop("id", None)
    content.pop("id", None)
    return CRS.from_json_dict(content).to_wkt()


def imported(crs: str, folder: Path) -> pd.DataFrame:
    """The exposures in a CRS."""
    project = load_project(PROJECT, (f"project.crs='{crs}'",))
    exposures = import_exposures(
        Store.of(folder), sources=project.inputs.exposures, cameras=project.cameras, project=project.project
    )
    return read_table(exposures["exposures"])
