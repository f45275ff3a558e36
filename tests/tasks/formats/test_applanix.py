"""Applanix EO files against the two published ones, whose latitudes and longitudes check the positions."""

from __future__ import annotations

import numpy as np
import pytest

from tasks.coordinates.crs import MapFrame
from tasks.errors import InputError
from tasks.formats.applanix import read_applanix
from tasks.settings.coordinates import ELLIPSOIDAL

ORDER = "omega-phi-kappa"


@pytest.fixture(scope="module")
def folder(test_data):
    return test_data / "format_samples" / "applanix_eo"


def latitude_longitude(path):
    text = path.read_text()
    rows = text[text.index("lat, long in") :].split("\n", 1)[1].split("\n")
    return np.array([[float(value) for value in row.split()[-2:]] for row in rows if row.strip()])


def test_the_map_sample_states_the_projection_its_latitudes_and_longitudes_are_of(folder):
    path = folder / "applanix_utm_eo_example.txt"
    records = read_applanix(path, ORDER)
    assert len(records.image) == 72
    assert records.position[0].tolist() == [470696.886, 5155353.811, 1997.734]
    assert records.time_s[0] == 576091.066218
    states = records.states
    assert (states.datum, states.heights, states.order, states.reference, states.position) == (
        "NAD83", "ellipsoidal", ORDER, "grid", "projection_centre",
    )  # fmt: skip
    for crs in (states.crs, "EPSG:26916"):
        # Latitude and longitude were printed without the shift that the header says was applied.
        unshifted = records.position - [-0.504388, 0.810880, -1.116507]
        geodetic = np.degrees(MapFrame(crs, ELLIPSOIDAL).to_geodetic(unshifted)[:, :2])
        # Printed to 1e-8 degrees and to 1 mm.
        np.testing.assert_allclose(geodetic, latitude_longitude(path), rtol=0, atol=2.0e-8)


def test_the_image_top_of_the_map_sample_points_along_flight(folder):
    """κ + azimuth of the track: median 0.13°, median deviation 0.16° over the legs (formats.md 6.1)."""
    records = read_applanix(folder / "applanix_utm_eo_example.txt", ORDER)
    step = np.diff(records.position, axis=0)
    same_line = np.diff(records.time_s) < 60.0
    azimuth = np.degrees(np.arctan2(step[:, 0], step[:, 1]))
    turned = (records.angles[:-1, 2] + azimuth + 180.0) % 360.0 - 180.0
    turned = turned[same_line & (np.hypot(step[:, 0], step[:, 1]) > 100.0)]
    assert abs(np.median(turned) - 0.13) < 0.05
    assert abs(np.median(np.abs(turned - np.median(turned))) - 0.16) < 0.05


def test_geocentric_positions_of_the_sample_are_its_latitudes_and_longitudes(folder):
    path = folder / "applanix_ecef_eo_example.txt"
    records = read_applanix(path, "heading-pitch-roll")
    np.testing.assert_allclose(records.position[:, 1::-1], latitude_longitude(path), rtol=0, atol=1.5e-8)
    assert records.angles[0].tolist() == [359.58758, 0.22249, -0.20272]
    assert records.states.order == "heading-pitch-roll"
    assert records.states.reference == "true-north"
    assert any("Average ground height 457.31" in remark for remark in records.remarks)


def test_damage_is_named_with_its_line(folder, tmp_path):
    lines = (folder / "applanix_utm_eo_example.txt").read_text().split("\n")
    row = next(k for k, line in enumerate(lines) if line.startswith("17657714"))

    def refusal(changed):
        path = tmp_path / "eo.txt"
        path.write_text("\n".join(changed))
        with pytest.raises(InputError) as raised:
            read_applanix(path, ORDER)
        return raised.value

    assert refusal([*lines[:row], "17657714 4 5x 1 2 3 4 5 6 7 8", *lines[row + 1 :]]).line == row + 1
    assert "Record Format" in refusal(lines[row:]).what
    assert (
        "metres" in refusal([line.replace("position in Meters", "position in Feet") for line in lines]).what
    )
    other = [
        line.replace("First rotation is about the 'x'", "First rotation is about the 'z'") for line in lines
    ]
    assert "about x by omega" in refusal(other).what
    assert "lack PHI" in refusal([line.replace("PHI, KAPPA", "FI, KAPPA") for line in lines]).what
