"""The place of the unknowns."""

from __future__ import annotations

import numpy as np

from adjust.geometry import rotation
from adjust.parameters import (
    BORESIGHT,
    FAMILIES,
    LEVER_ARM,
    ParameterLayout,
    Quantity,
    State,
    SystemParameters,
    additional_family,
)


def parameters(name: str, free: list[list[bool]]) -> SystemParameters:
    entities = tuple(f"entity_{i}" for i in range(len(free)))
    values = np.arange(float(np.size(free))).reshape(np.shape(free))
    return SystemParameters(FAMILIES[name], entities, values, np.array(free))


LAYOUT = ParameterLayout(
    2,
    1,
    (
        parameters(BORESIGHT, [[True, False, True], [False, False, False]]),
        parameters(LEVER_ARM, [[False, True, False], [True, True, True]]),
    ),
)


def test_free_parameters_have_consecutive_columns_and_held_ones_none() -> None:
    np.testing.assert_array_equal(LAYOUT.columns[BORESIGHT], [[0, -1, 1], [-1, -1, -1]])
    np.testing.assert_array_equal(LAYOUT.columns[LEVER_ARM], [[-1, 2, -1], [3, 4, 5]])
    assert LAYOUT.border == 6
    assert LAYOUT.unknowns == 6 * 2 + 3 * 1 + 6


def test_a_set_of_a_camera_in_one_flight_has_both_and_is_called_by_both() -> None:
    family = additional_family(("set:1", "set:2"), ("1", "1"))
    values = np.zeros((2, 2))
    sets = SystemParameters(family, ("A", "A"), values, values == 0.0, ("B", ""))
    assert sets.quantity(0, 1) == Quantity("set:2", camera="A", flight="B")
    assert str(sets.quantity(0, 1)) == "set:2 of A in B"
    assert sets.quantity(1, 0).entity == "A in the flight"
    assert Quantity("set:2", camera="A in B") != sets.quantity(0, 1)


def test_names_stand_in_the_order_of_the_columns() -> None:
    assert LAYOUT.border_names() == (
        ("boresight_roll", "entity_0", "rad"),
        ("boresight_yaw", "entity_0", "rad"),
        ("lever_arm_y", "entity_0", "m"),
        ("lever_arm_x", "entity_1", "m"),
        ("lever_arm_y", "entity_1", "m"),
        ("lever_arm_z", "entity_1", "m"),
    )


def test_an_update_moves_what_is_free_and_turns_cameras_in_their_own_axes() -> None:
    state = State(
        np.zeros((2, 3)),
        np.stack([np.eye(3), rotation.about_z(np.pi / 2)]),
        np.ones((1, 3)),
        {p.family.name: p.values for p in LAYOUT.system},
    )
    of_exposures = np.zeros((2, 6))
    of_exposures[0, :3] = [1.0, 2.0, 3.0]
    of_exposures[1, 3:] = [0.1, 0.0, 0.0]
    after = LAYOUT.update(state, of_exposures, 10.0 + np.arange(6.0), np.full((1, 3), 0.5))
    np.testing.assert_array_equal(after.projection_centre[0], [1.0, 2.0, 3.0])
    expected = rotation.about_z(np.pi / 2) @ rotation.about_x(0.1)
    np.testing.assert_allclose(after.local_from_camera[1], expected, atol=1e-16)
    np.testing.assert_array_equal(after.object_point, [[1.5, 1.5, 1.5]])
    np.testing.assert_array_equal(after.system[BORESIGHT], [[10.0, 1.0, 13.0], [3.0, 4.0, 5.0]])
    np.testing.assert_array_equal(after.system[LEVER_ARM], [[0.0, 13.0, 2.0], [16.0, 18.0, 20.0]])
    # The state before is untouched.
    np.testing.assert_array_equal(state.system[BORESIGHT], [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])


def test_names_of_parameters_are_unique_over_all_families() -> None:
    names = [component for family in FAMILIES.values() for component in family.components]
    assert len(names) == len(set(names))
