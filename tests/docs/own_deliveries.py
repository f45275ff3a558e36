"""Three folders as departments deliver them, of one simulated block: the practice of the tutorial.

The exposures are written as an Applanix file and as an XML of Metashape by hand, after the published samples,
because nothing of ours writes these formats; OpenSfM's folder comes from ``aerocal export``.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from adjust.geometry.earth import TopocentricFrame, ecef_from_enu, ecef_from_geodetic
from adjust.geometry.rotation import from_omega_phi_kappa
from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_frame, local_from_grid, local_from_map
from tasks.handover.delivery import Angles
from tasks.handover.export import export_results
from tasks.settings.coordinates import ELLIPSOIDAL
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulate import simulate_project

CRS = "EPSG:32632"
BLOCK = (
    "flight.0.lines=2", "flight.0.exposures=6", "flight.1.lines=2", "flight.1.exposures=4",
    "points.count=300", "project.angles=omega-phi-kappa", f"project.crs={CRS}", "project.latitude_deg=48.9",
    "project.longitude_deg=9.6", "truth.boresight_deg=[0,0,0]", "truth.gnss_shift_m=[0,0,0]",
    "truth.focal_length_change_mm=0", "truth.principal_point_change_mm=[0,0]",
)  # fmt: skip
_HEADER = """\
 POSEO by the practice of the tutorial
 Mapping frame datum: WGS84  ; Mapping frame projection : TM;
 central meridian = 9.000000 deg;
 latitude of the grid origin = 0.000000 deg; grid scale factor = 0.999600:
 false easting = 500000.000000 m; false northing = 0.000000 m;
    First rotation is about the 'x' axis by the 'omega' angle.
    Second rotation is about the 'y' axis by the 'phi' angle.
    Third rotation is about the 'z' axis by the 'kappa' angle.
 POS/AV Computed Data at Camera Perspective Centre

 Record Format:

 ID, # EVENT, TIME (s), EASTING, NORTHING, ELLIPSOID HEIGHT, OMEGA, PHI, KAPPA, LAT, LONG

 (position in Meters, orientation in Degrees, lat, long in Deg)

"""


class Block:
    """The simulated block and its tables; pixels count from the corner of the first one."""

    def __init__(self, folder: Path) -> None:
        simulation = load_simulation("uce-high", BLOCK)
        simulate_project(simulation, folder)
        text = {"point": str, "image": str, "strip": str, "flight": str}
        self.folder, self.camera = folder, simulation.camera
        self.exposures, self.points, self.control = (
            pd.read_csv(folder / f"{name}.csv", dtype=text)
            for name in ("exposures", "image_points", "control")
        )
        half = 0.5 * np.array([self.camera.columns, self.camera.rows])
        pixels = self.points[["x", "y"]].to_numpy() * [1.0, -1.0] / (self.camera.pixel_um * 1e-3) + half
        self.points[["column", "row"]] = pixels
        self.surveyed = self.points["point"].isin(self.control["point"])


def classical(block: Block, folder: Path) -> None:
    """Applanix EO, image points in lists of photos (PATB, micrometres), control as a table of a surveyor."""
    folder.mkdir()
    rows = [
        f"{row.image} {k:5d} {row.time:.6f} {row.x:.3f} {row.y:.3f} {row.z:.3f} "
        f"{row.omega:.5f} {row.phi:.5f} {row.kappa:.5f} 48.9 9.6"
        for k, row in enumerate(block.exposures.itertuples(), start=1)
    ]
    (folder / "eo_block7.txt").write_text(_HEADER + "\n".join(rows) + "\n")
    (folder / "block7.im").write_text("".join(_photo_lists(block)))
    table = block.control.rename(columns={"point": "Name", "x": "Easting", "y": "Northing", "z": "Height"})
    text = table[["Name", "Easting", "Northing", "Height"]].to_csv(
        index=False, sep=";", decimal=",", float_format="%.3f"
    )
    (folder / "survey.csv").write_text(text)
    (folder / "readme.txt").write_text("Flown in May.\n")


def _photo_lists(block: Block) -> Iterator[str]:
    for image, own in block.points.groupby("image"):
        yield f"{image} {block.camera.focal_length_mm * 1e3:.1f}\n"
        for row in own.itertuples():
            yield f"{row.point} {row.x * 1e3:.2f} {row.y * 1e3:.2f}\n"
        yield "-99\n"


def open_source(block: Block, folder: Path) -> None:
    """OpenSfM's reconstruction and tracks as ODM leaves them, and a list of ground control points."""
    outcome = carry_out(
        aerial_triangulation, RunRequest(block.folder / "project.toml", block.folder / "results")
    )
    assert outcome.error is None, outcome.error
    angles = Angles("omega-phi-kappa", "deg")
    export_results(block.folder / "results", "opensfm", folder, None, angles, force=False)
    for of_ours in ("HANDOVER.txt", "geo.txt"):
        (folder / of_ours).unlink()
    tracks = (folder / "tracks.csv").read_text().splitlines(keepends=True)
    surveyed = set(block.control["point"])
    (folder / "tracks.csv").write_text(
        "".join(line for k, line in enumerate(tracks) if k == 0 or line.split("\t")[1] not in surveyed)
    )
    place = block.control.set_index("point")
    with (folder / "gcp_list.txt").open("w") as stream:
        stream.write(f"{CRS}\n")
        for row in block.points[block.surveyed].itertuples():
            x, y, z = place.loc[row.point, ["x", "y", "z"]]
            # Zero is the middle of the first pixel there.
            place_in_image = f"{row.column - 0.5:.3f} {row.row - 0.5:.3f} {row.image}"
            stream.write(f"{x:.3f} {y:.3f} {z:.3f} {place_in_image} {row.point}\n")


def metashape(block: Block, folder: Path) -> None:
    """XML of cameras, placed on the earth by the transform of the chunk, and of markers."""
    folder.mkdir()
    frame = MapFrame.of(CRS, ELLIPSOIDAL)
    place = block.exposures[["x", "y", "z"]].to_numpy()
    local = local_frame(frame, place)
    assert isinstance(local, TopocentricFrame)
    centre = local_from_map(frame, local, place)
    angles = np.deg2rad(block.exposures[["omega", "phi", "kappa"]].to_numpy())
    rotation = (
        local_from_grid(frame, local, place) @ from_omega_phi_kappa(angles) @ np.diag([1.0, -1.0, -1.0])
    )
    camera = block.camera
    pose = np.tile(np.eye(4), (len(centre), 1, 1))
    pose[:, :3, :3], pose[:, :3, 3] = rotation, centre
    to_earth = ecef_from_enu(local.latitude, local.longitude)
    origin = ecef_from_geodetic(frame.ellipsoid, np.array([[local.latitude, local.longitude, 0.0]]))[0]
    cameras = "".join(
        f'<camera id="{k}" sensor_id="0" component_id="0" label="{name}"><transform>'
        f"{_numbers(matrix)}</transform>"
        "</camera>\n"
        for k, (name, matrix) in enumerate(zip(block.exposures["image"], pose, strict=True))
    )
    (folder / "cameras.xml").write_text(
        f'<document version="2.0.0"><chunk><sensors><sensor id="0" label="{camera.name}" type="frame">'
        f'<resolution width="{camera.columns}" height="{camera.rows}"/><calibration class="adjusted">'
        f"<f>{camera.focal_length_mm / camera.pixel_um * 1e3!r}</f>"
        '<cx>0</cx><cy>0</cy></calibration></sensor></sensors><components><component id="0"><transform>'
        f"<rotation>{_numbers(to_earth)}</rotation><translation>{_numbers(origin)}</translation>"
        f"<scale>1</scale></transform></component></components><cameras>\n{cameras}</cameras></chunk></document>\n"
    )
    (folder / "markers.xml").write_text(_markers(block))


def _markers(block: Block) -> str:
    number = {name: k for k, name in enumerate(block.exposures["image"])}
    cameras = "".join(f'<camera id="{k}" label="{name}"/>' for name, k in number.items())
    markers, frames = "", ""
    for k, row in enumerate(block.control.itertuples()):
        markers += (
            f'<marker id="{k}" label="{row.point}"><reference x="{row.x:.3f}" y="{row.y:.3f}" '
            f'z="{row.z:.3f}" enabled="{"false" if row.role == "check" else "true"}"/></marker>\n'
        )
        own = block.points[block.points["point"] == row.point]
        places = "".join(
            f'<location camera_id="{number[one.image]}" pinned="true" x="{one.column:.3f}" '
            f'y="{one.row:.3f}"/>'
            for one in own.itertuples()
        )
        frames += f'<marker marker_id="{k}">{places}</marker>\n'
    return (
        f"<document><chunk><cameras>{cameras}</cameras><markers>{markers}</markers><frames>"
        f'<frame id="0"><markers>{frames}</markers></frame></frames></chunk></document>\n'
    )


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{value:.15g}" for value in np.ravel(values))
