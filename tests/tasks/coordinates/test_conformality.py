from __future__ import annotations

import numpy as np
import pyproj
import pytest

from tasks.coordinates.conformality import angular_distortion, refuse_distorted_angles
from tasks.coordinates.crs import MapFrame
from tasks.errors import InputError
from tasks.settings.coordinates import ELLIPSOIDAL


@pytest.mark.parametrize(
    "name",
    [
        "EPSG:2154",
        "EPSG:32632",
        "EPSG:31467",
        "EPSG:21781",
        "EPSG:27572",
        "EPSG:2193",
        "EPSG:28992",
    ],
)
def test_conformal_projections_pass(name):
    refuse_distorted_angles(MapFrame.of(name, ELLIPSOIDAL))


@pytest.mark.parametrize("name", ["EPSG:3035", "EPSG:6933", "EPSG:32662"])
def test_projections_that_distort_angles_are_refused(name):
    with pytest.raises(InputError, match="distorts angles"):
        refuse_distorted_angles(MapFrame.of(name, ELLIPSOIDAL))


def test_the_distortion_is_the_one_proj_gives():
    frame = MapFrame.of("EPSG:3035", ELLIPSOIDAL)
    places = np.radians([[40.0, -5.0], [60.0, 30.0], [52.0, 10.0]])
    factors = pyproj.Proj("EPSG:3035").get_factors(*np.degrees(places[:, ::-1]).T)
    expected = np.radians(factors.angular_distortion)
    np.testing.assert_allclose(angular_distortion(frame, places), expected, atol=1e-7)


def test_grid_angles_of_an_input_in_such_a_projection_are_refused(delivery):
    delivery.change(
        "project",
        'exposures.csv"\nformat = "csv"\ncrs = "EPSG:32632"',
        'exposures.csv"\nformat = "csv"\ncrs = "EPSG:3035"',
    )
    with pytest.raises(InputError, match="distorts angles"):
        delivery.exposures()


def test_results_in_such_a_projection_are_refused(delivery):
    with pytest.raises(InputError, match="distorts angles"):
        delivery.control("project.crs=EPSG:3035")
