"""The parameters of a plan as named on the command line."""

from __future__ import annotations

from adjust.camera.additional.register import REGISTER
from adjust.camera.additional.selection import selected
from adjust.errors import AdditionalParametersError
from tasks.errors import InputError
from tasks.nearest_name import did_you_mean
from tasks.quantities import KINDS
from tasks.settings.adjustment import FreeParameter


def free_from_text(text: str) -> tuple[FreeParameter, ...]:
    """Names separated by commas, as in `adjustment.free`.

    Raises
    ------
    InputError
        If one of them does not exist, or there is none.
    """
    names = list(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    for name in names:
        if name not in KINDS:
            raise InputError(
                f"'{name}' is not a parameter that can be calibrated.", did_you_mean(name, KINDS)
            )
    if not names:
        raise InputError("--free names no parameter.", f"Name at least one of: {', '.join(KINDS)}.")
    return tuple(names)


def selection_from_text(text: str) -> str:
    """A selection of additional parameters, as in `adjustment.self_calibration.parameters`.

    Raises
    ------
    InputError
        If the register does not know it.
    """
    try:
        selected(text, REGISTER)
    except AdditionalParametersError as error:
        raise InputError(
            f"The additional parameters '{text}' are not known: {error}",
            'Write for example "bluh:1-12"; docs/additional-parameters.md lists all sets.',
            entity="--additional",
        ) from error
    return text.strip()
