from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.geometry.rotation import from_omega_phi_kappa
from tasks.coordinates.local_frame import local_frame, local_from_grid, local_from_map
from tasks.deliveries.cameras import frame_cameras
from tasks.settings.load import load_project
from tasks.stages.ingest import import_control, import_exposures, import_image_points, project_frame
from tasks.store.notes import read_notes
from tasks.store.store import Store
from tasks.tables.parquet import read_table

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture
def imported(test_data, tmp_path):
    def run(example, *overrides):
        path = EXAMPLES / example / "project.toml"
        project = load_project(path, overrides, environment={"AEROCAL_TEST_DATA": str(test_data)})
        store = Store.of(tmp_path)
        read = import_exposures(
            store, sources=project.inputs.exposures, cameras=project.cameras, project=project.project
        )
        points = import_image_points(
            store, sources=project.inputs.image_points, exposures=read["exposures"], cameras=read["cameras"]
        )
        control = import_control(store, sources=project.inputs.control, project=project.project)
        return project, read, points, control

    return run


def control_residuals_px(project, read, points, control):
    """Residuals (n, 2) along column and row of the control points at the given orientations."""
    exposures = read_table(read["exposures"]).set_index("image")
    surveyed = read_table(control["control_points"])
    measured = read_table(points["image_points"])
    measured = measured[measured["point"].isin(surveyed["point"])]
    frame = project_frame(project.project)
    x_in_map = exposures[["x_m", "y_m", "z_m"]].to_numpy(float)
    local = local_frame(frame, x_in_map)
    centre = pd.DataFrame(local_from_map(frame, local, x_in_map), exposures.index)
    angles = np.radians(exposures[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy(float))
    rotation = local_from_grid(frame, local, x_in_map) @ from_omega_phi_kappa(angles)
    ground = local_from_map(frame, local, surveyed[["x_m", "y_m", "z_m"]].to_numpy(float))
    target = pd.DataFrame(ground, surveyed["point"]).loc[measured["point"]].to_numpy()
    row = exposures.index.get_indexer(measured["image"])
    camera = frame_cameras(read_table(read["cameras"]))[exposures["camera"].iloc[0]]
    p = np.einsum("nji,nj->ni", rotation[row], target - centre.to_numpy()[row])
    xy = -camera.focal_length * p[:, :2] / p[:, 2:] + np.array(camera.principal_point)
    return (xy - measured[["x_mm", "y_mm"]].to_numpy() * 1e-3) / camera.pixel_size


def rms(residuals):
    return np.sqrt(np.mean(residuals**2, axis=0))


def test_control_against_given_orientations_with_geoid_and_linear_alteration(imported):
    np.testing.assert_allclose(rms(control_residuals_px(*imported("ign_borea"))), [0.70, 0.35], atol=0.05)


def test_the_linear_alteration_must_be_undone(imported, test_data):
    grid = test_data / "ign_borea_uce_m3" / "fr_ign_RAF20.tif"
    residuals = control_residuals_px(*imported("ign_borea", f'inputs.exposures.heights={{geoid="{grid}"}}'))
    np.testing.assert_allclose(rms(residuals), [3.30, 1.55], atol=0.1)


def test_the_geoid_matters_by_its_whole_undulation(imported):
    residuals = control_residuals_px(*imported("ign_borea", "inputs.exposures.heights=ellipsoidal"))
    assert (rms(residuals) > 100.0).all()


def test_the_eagle_block_is_read_completely(imported):
    _, read, points, control = imported("ign_ultracam_eagle")
    table = read_table(points["image_points"])
    tie = table[table["point"] != "724046"]
    assert (len(tie), tie["point"].nunique()) == (18132, 6462)
    assert len(table) == 18137
    rays = tie.groupby("point").size().value_counts().to_dict()
    assert rays == {2: 3153, 3: 2308, 4: 372, 5: 360, 6: 269}
    notes = read_notes(points["notes"])
    assert notes.figures["counts"]["single_ray_points"] == 2075
    assert any(
        problem.startswith("2,075 points are measured in one image only") for problem in notes.problems
    )
    exposures = read_table(read["exposures"])
    assert len(exposures) == 5856
    assert set(exposures["flight"]) == {"21FD244720"}
    used = exposures[exposures["image"].isin(table["image"])]
    assert sorted(used["strip"].unique()) == ["x00015", "x00016", "x00017"]
    assert read_table(control["control_points"])[["x_m", "y_m", "z_m"]].to_numpy().tolist() == [
        [521565.58, 6459960.99, 252.83]
    ]


def test_the_adjusted_orientations_of_the_eagle_block_need_their_height_conversion(test_data, tmp_path):
    # IGN's adjusted orientations against the trajectory: the same projection centres within a metre, after
    # geoid and linear alteration; 51 m apart in height without.
    project = load_project(
        EXAMPLES / "ign_ultracam_eagle" / "project.toml", environment={"AEROCAL_TEST_DATA": str(test_data)}
    )
    adjusted = project.inputs.exposures[0].model_dump(exclude_unset=True) | {
        "file": str(test_data / "ign_ultracam_eagle_m3" / "21FD2447_alt_s07.OPK"),
        "heights": {
            "geoid": str(test_data / "ign_borea_uce_m3" / "fr_ign_RAF20.tif"),
            "linear_alteration": {"ground_m": 205.0},
        },
    }
    source = type(project.inputs.exposures[0]).model_validate(adjusted)
    store = Store.of(tmp_path)
    tables = []
    for sources in (project.inputs.exposures, (source,)):
        read = import_exposures(store, sources=sources, cameras=project.cameras, project=project.project)
        tables.append(read_table(read["exposures"]).set_index("image"))
    raw, reference = tables
    difference = (raw.loc[reference.index, "z_m"] - reference["z_m"]).to_numpy()
    assert len(difference) == 2739
    assert abs(np.median(difference)) < 1.0
