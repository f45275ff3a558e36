"""Additional parameters of self-calibration: one file for each family of sets, and their register.

How to add a set: write a file with its :class:`~adjust.camera.additional.base.ParameterSet` (terms with
meaning, unit, source and honest status; the basis functions), and name it in ``register.py``. The
contract tests of ``tests/adjust/camera/additional`` then run over it, and it can be selected by name:

    additional_parameters("bluh:1-12+42-73", ImageFormat(half_x, half_y)).basis(xy)
"""
