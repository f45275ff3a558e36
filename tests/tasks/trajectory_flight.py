"""A simulated trajectory as a delivery that tests can change, and what its exposures really are."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from adjust.geometry import rotation
from adjust.geometry.rotation import ENU_FROM_NED
from adjust.simulate.block import SimulatedBlock
from adjust.simulate.flown_path import flown_path
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import AdjustmentFrame, local_from_map
from tasks.deliveries.exposures import exposure_columns
from tasks.errors import InputError
from tasks.settings.base import PathContext
from tasks.settings.inputs import ExposuresInput

OFFSET, ARM = 0.003, (0.3, 0.1, -1.0)
SPEC = f"""
preset = "uce-high"
[project]
crs = "EPSG:25832"
latitude_deg = 48.9
longitude_deg = 9.3
[[flight]]
name = "S"
height_m = 1950.0
heading_deg = 70.0
exposures = [4, 4]
speed_m_s = 60.0
[points]
count = 60
[control]
control = 4
[trajectory]
sbet_hz = 200.0
[truth]
time_offset_s = {OFFSET}
lever_arm_m = {list(ARM)}
gnss_shift_m = [0.0, 0.0, 0.0]
[noise]
level = 0
"""


@dataclass(frozen=True)
class Flight:
    folder: Path
    block: SimulatedBlock
    map_frame: MapFrame
    frame: AdjustmentFrame

    @property
    def declared(self):
        return tomllib.loads((self.folder / "project.toml").read_text())["inputs"]["exposures"][0]

    def source(self, **changes):
        """The declared input with other keys; None takes one out."""
        declared = self.declared
        for key, value in changes.items():
            table = {**declared.get(key, {}), **value} if isinstance(value, dict) else value
            declared[key] = _without_none(table) if isinstance(table, dict) else table
        return ExposuresInput.model_validate(_without_none(declared), context=PathContext(self.folder))

    def imported(self, **changes):
        """Columns and remarks of the exposures, in the order of the events."""
        camera = self.block.specification.cameras[0].name
        columns, _, notes, _ = exposure_columns([self.source(**changes)], (camera,), self.map_frame)
        return columns, notes.problems

    def refused(self, **changes):
        with pytest.raises(InputError) as raised:
            self.imported(**changes)
        return raised.value

    def samples(self):
        content = (self.folder / "trajectory.sbet").read_bytes()
        return np.frombuffer(content, "<f8").reshape(-1, 17).copy()

    def write(self, name, table):
        (self.folder / name).write_bytes(np.ascontiguousarray(table, "<f8").tobytes())
        return name


def _without_none(table):
    return {key: value for key, value in table.items() if value is not None}


def stacked(columns, *names):
    return np.column_stack([columns[name] for name in names])


def errors(flight, columns, offset=OFFSET):
    """Positions (m), attitudes (degrees), rates (degrees/s) of the columns minus those of the path."""
    plan, flown = flight.block.truth.plan, flight.block.truth.trajectory
    time = flown.time[[plan.images.index(name) for name in columns["image"].to_pylist()]] + offset
    path = flown_path(plan, flown, 0)
    attitude = path.local_from_body(time)
    place = local_from_map(flight.map_frame, flight.frame, stacked(columns, "x_m", "y_m", "z_m"))
    found = (
        np.asarray(flight.frame.local_from_enu(place))
        @ ENU_FROM_NED
        @ rotation.ned_from_body(np.radians(stacked(columns, "heading_deg", "pitch_deg", "roll_deg")))
    )
    turn = np.linalg.norm(rotation.log(np.swapaxes(attitude, 1, 2) @ found), axis=1)
    rates = stacked(columns, "rate_roll_deg_s", "rate_pitch_deg_s", "rate_yaw_deg_s")
    return (
        np.linalg.norm(place - path.position(time) - attitude @ np.array(ARM), axis=1),
        np.degrees(turn),
        np.abs(rates - np.degrees(path.rate(time))).max(axis=1),
    )


def solution_of(flight, qualities, hertz=5):
    """The trajectory of the antenna as RTKLIB writes it; Q changes from second to second."""
    table = flight.samples()[:: 200 // hertz]
    head = "%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)\n"
    rows = [
        f"2200 {row[0]:.3f} {np.degrees(row[1]):.12f} {np.degrees(row[2]):.12f} {row[3]:.6f} "
        f"{qualities[int(row[0]) % len(qualities)]} 9 0.01 0.02 0.03\n"
        for row in table
    ]
    (flight.folder / "solution.pos").write_text(head + "".join(rows))
    angles = {"unit": "deg", "rate_axes": None}
    return {"file": "solution.pos", "format": "rtklib", "trajectory": None, "angles": angles}
