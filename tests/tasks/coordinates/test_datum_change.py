from __future__ import annotations

import numpy as np
import pytest

from adjust.geometry.earth import ecef_from_enu, ecef_from_geodetic
from tasks.coordinates.crs import MapFrame
from tasks.coordinates.datum_change import Transfer
from tasks.errors import InputError
from tasks.settings.coordinates import ELLIPSOIDAL, Heights

LAMBERT93 = MapFrame.of("EPSG:2154", ELLIPSOIDAL)
PLACE = np.array([[521565.58, 6459960.99, 252.83]])


def test_the_same_frame_touches_no_digit():
    transfer = Transfer.between(LAMBERT93, MapFrame.of("EPSG:2154", ELLIPSOIDAL))
    assert transfer.is_identity
    assert transfer.positions(PLACE).tolist() == PLACE.tolist()


def test_another_projection_of_the_same_datum_keeps_east_north_and_up():
    transfer = Transfer.between(LAMBERT93, MapFrame.of("EPSG:3945", ELLIPSOIDAL))
    assert transfer.keeps_datum
    np.testing.assert_array_equal(transfer.target_enu_from_source_enu(PLACE)[0], np.eye(3))
    there = transfer.positions(PLACE)
    back = Transfer.between(transfer.target, LAMBERT93).positions(there)
    np.testing.assert_allclose(back, PLACE, atol=2e-9)


def test_axes_turn_by_the_difference_of_the_convergences():
    target = MapFrame.of("EPSG:3945", ELLIPSOIDAL)
    transfer = Transfer.between(LAMBERT93, target)
    there = transfer.positions(PLACE)
    rotation = transfer.target_grid_from_source_grid(PLACE, there)[0]
    turn = target.convergence(there)[0] - LAMBERT93.convergence(PLACE)[0]
    np.testing.assert_allclose(np.arctan2(rotation[1, 0], rotation[0, 0]), turn, atol=1e-14)


def test_a_datum_with_a_missing_grid_is_refused_and_names_it():
    with pytest.raises(InputError, match="lacks the grid") as raised:
        Transfer.between(MapFrame.of("EPSG:31467", ELLIPSOIDAL), MapFrame.of("EPSG:25832", ELLIPSOIDAL))
    assert "BETA2007" in raised.value.what
    assert "http" not in str(raised.value)


def test_between_two_realisations_of_etrs89_the_published_null_transformation_is_used():
    transfer = Transfer.between(LAMBERT93, MapFrame.of("EPSG:25831", ELLIPSOIDAL))
    assert transfer.accuracy_m == 0.1
    assert "RGF93 v1 to ETRS89" in transfer.description
    direct = MapFrame.of("EPSG:25831", ELLIPSOIDAL).from_geodetic(LAMBERT93.to_geodetic(PLACE))
    np.testing.assert_allclose(transfer.positions(PLACE), direct, atol=1e-6)


def test_the_axes_of_two_datums_differ_by_the_rotation_of_the_same_vectors():
    # TM65 to ETRS89 is a seven-parameter transformation: a few seconds of arc.
    source, target = MapFrame.of("EPSG:29902", ELLIPSOIDAL), MapFrame.of("EPSG:25829", ELLIPSOIDAL)
    transfer = Transfer.between(source, target)
    start = np.array([[200000.0, 250000.0, 100.0]])
    east = transfer.target_enu_from_source_enu(start)[0] @ np.array([1.0, 0.0, 0.0])

    def in_enu(frame, ends):
        geodetic = frame.to_geodetic(ends)
        ecef = ecef_from_geodetic(frame.ellipsoid, geodetic)
        return ecef_from_enu(geodetic[0, 0], geodetic[0, 1]).T @ (ecef[1] - ecef[0])

    geodetic = source.to_geodetic(start)
    radius = source.ellipsoid.semi_major_m * np.cos(geodetic[0, 0])
    end = source.from_geodetic(geodetic + np.array([[0.0, 500.0 / radius, 0.0]]))
    ends = np.vstack([start, end])
    given = in_enu(source, ends)
    image = in_enu(target, transfer.positions(ends))
    turned = transfer.target_enu_from_source_enu(start)[0] @ given
    np.testing.assert_allclose(image / np.linalg.norm(image), turned / np.linalg.norm(turned), atol=1e-8)
    assert 1e-6 < np.linalg.norm(east - [1.0, 0.0, 0.0]) < 1e-4


def test_local_and_earthly_systems_do_not_mix():
    with pytest.raises(InputError, match="cannot be combined"):
        Transfer.between(MapFrame.of("local", ELLIPSOIDAL), LAMBERT93)


def test_only_the_height_system_may_differ(test_data):
    grid = test_data / "ign_borea_uce_m3" / "fr_ign_RAF20.tif"
    altitudes = MapFrame.of("EPSG:2154", Heights(geoid=grid))
    transfer = Transfer.between(altitudes, LAMBERT93)
    shift = transfer.positions(PLACE) - PLACE
    np.testing.assert_allclose(shift[0, :2], 0.0, atol=2e-9)
    np.testing.assert_allclose(shift[0, 2], 47.40713, atol=1e-4)
