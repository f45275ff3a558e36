"""What is said of the points from which the accuracy of direct georeferencing is derived."""

from __future__ import annotations

from tasks.georeferencing.remarks import point_remarks


def test_control_of_a_known_calibration_is_no_evidence() -> None:
    (sentence,) = point_remarks(40, 1, is_known=True)
    assert sentence.startswith("1 surveyed point was control of the calibration.")


def test_of_given_camera_values_nobody_says_what_they_were_determined_with() -> None:
    control, nothing = point_remarks(0, 3, is_known=False)
    assert control.startswith("It is not known whether the given camera values were determined with the 3 ")
    assert "declare check points (inputs.control.check_points)" in control
    assert nothing.startswith("There is no independent check point")
