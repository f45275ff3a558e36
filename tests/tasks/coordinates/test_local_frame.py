from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from adjust.geometry.earth import CartesianFrame, TopocentricFrame
from adjust.geometry.rotation import from_omega_phi_kappa, ned_from_body, to_omega_phi_kappa
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.local_frame import local_frame, local_from_grid, local_from_map, map_from_local
from tasks.settings.coordinates import ELLIPSOIDAL

UTM33 = MapFrame.of("EPSG:32633", ELLIPSOIDAL)
ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
CAMERA_TO_BODY = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@settings(max_examples=50, deadline=None)
@given(
    x=st.floats(-20000.0, 20000.0),
    y=st.floats(-20000.0, 20000.0),
    z=st.floats(-50.0, 9000.0),
    seed=st.integers(0, 99),
)
def test_map_and_local_coordinates_are_inverse(x, y, z, seed):
    centre = np.array([[400000.0 + 2000.0 * seed, 5300000.0, 0.0]])
    frame = local_frame(UTM33, centre)
    place = centre + np.array([[x, y, z]])
    back = map_from_local(UTM33, frame, local_from_map(UTM33, frame, place))
    np.testing.assert_allclose(back, place, rtol=0, atol=5e-9)


def test_the_origin_is_the_middle_of_the_block_at_height_zero():
    corners = np.array(
        [[500000.0, 5300000.0, 900.0], [510000.0, 5304000.0, 1500.0], [500100.0, 5300100.0, 0.0]]
    )
    frame = local_frame(UTM33, corners)
    assert isinstance(frame, TopocentricFrame)
    origin = local_from_map(UTM33, frame, np.array([[505000.0, 5302000.0, 0.0]]))
    np.testing.assert_allclose(origin, 0.0, atol=1e-8)


def test_distances_in_the_local_frame_are_true_ones():
    # On the central meridian of UTM the scale is 0.9996 and a distance in the map is too short by as much.
    frame = local_frame(UTM33, np.array([[500000.0, 5300000.0, 0.0]]))
    ends = local_from_map(UTM33, frame, np.array([[500000.0, 5299000.0, 0.0], [500000.0, 5301000.0, 0.0]]))
    np.testing.assert_allclose(np.linalg.norm(ends[1] - ends[0]), 2000.0 / 0.9996, atol=1e-4)


def test_the_ground_curves_away_below_the_local_plane():
    frame = local_frame(UTM33, np.array([[500000.0, 5300000.0, 0.0]]))
    drop = local_from_map(UTM33, frame, np.array([[503000.0 * 1.0, 5300000.0, 0.0]]))[0, 2]
    np.testing.assert_allclose(drop, -(3000.0**2) / (2 * 6.388e6), rtol=5e-3)  # −0.70 m at 3 km


def test_grid_angles_and_true_heading_give_one_rotation_in_the_local_frame():
    # Test vector: 48° N, 12° E in UTM 33, heading 87.5°, pitch −0.8°, roll 1.2°, image top forward.
    place = UTM33.from_geodetic(np.array([[np.radians(48.0), np.radians(12.0), 1500.0]]))
    frame = TopocentricFrame(UTM33.ellipsoid, float(np.radians(47.9)), float(np.radians(12.3)))
    x_in_local = local_from_map(UTM33, frame, place)
    body = ned_from_body(np.radians([[87.5, -0.8, 1.2]]))
    from_heading = frame.local_from_enu(x_in_local) @ ENU_FROM_NED @ body @ CAMERA_TO_BODY
    grid = from_omega_phi_kappa(np.radians([[1.196340, 0.805463, -89.747143]]))
    from_grid = local_from_grid(UTM33, frame, place) @ grid
    np.testing.assert_allclose(from_grid, from_heading, atol=3e-8)
    np.testing.assert_allclose(
        np.degrees(to_omega_phi_kappa(from_grid))[0], [1.066952, 0.646175, -87.735860], atol=3e-6
    )


def test_a_local_project_is_its_own_frame():
    frame = MapFrame.of("local", ELLIPSOIDAL)
    places = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    local = local_frame(frame, places)
    assert isinstance(local, CartesianFrame)
    np.testing.assert_array_equal(local_from_map(frame, local, places), places)
    np.testing.assert_array_equal(map_from_local(frame, local, places), places)
    np.testing.assert_array_equal(
        local_from_grid(frame, local, places), np.broadcast_to(np.eye(3), (2, 3, 3))
    )
