"""What a calibration can estimate from what the project observes: without GNSS there is no GNSS shift.

The first of two steps observes control points alone.
"""

from __future__ import annotations

from collections.abc import Mapping

from adjust.camera.additional.selection import NOTHING
from tasks.errors import InputError
from tasks.quantities import KINDS
from tasks.settings.adjustment import ObservedGroup
from tasks.settings.project import Project

_WORDS: Mapping[ObservedGroup, str] = {"gnss": "GNSS positions", "ins": "INS attitudes"}


def observable(project: Project) -> tuple[Project, tuple[str, ...]]:
    """The project without what nothing observes, and a remark for each group that is missing.

    Raises
    ------
    InputError
        If nothing is left to calibrate.
    """
    calibration, remarks = project.calibration, []
    free = calibration.free
    for group, words in _WORDS.items():
        dropped = [name for name in free if KINDS[name].observed_by == group]
        if group not in project.adjustment.observe and dropped:
            free = tuple(name for name in free if name not in dropped)
            remarks.append(
                f"No {words} are observed (adjustment.observe), so there is nothing from which to calibrate "
                f"{' and '.join(dropped)} with."
            )
    if not free and project.adjustment.self_calibration.parameters == NOTHING:
        raise InputError(
            f"No observation determines what calibration.free lists: {', '.join(calibration.free)}.",
            "Observe GNSS and INS (adjustment.observe), or free only what control points determine: "
            "focal_length, principal_point.",
            entity="calibration.free",
        )
    return project.model_copy(update={"calibration": calibration.model_copy(update={"free": free})}), tuple(
        remarks
    )


def is_georeferenced(project: Project) -> bool:
    """Whether exposures are observed as positions and attitudes; else they are approximate values only."""
    return {"gnss", "ins"} <= set(project.adjustment.observe)


def control_alone(project: Project) -> Project:
    """The same project, adjusted on its control points with the cameras as they are given.

    GNSS and INS still give approximate values; all their parameters are held.
    """
    own = project.adjustment.self_calibration.model_copy(update={"parameters": NOTHING})
    adjustment = project.adjustment.model_copy(
        update={
            "free": (),
            "observe": ("control",),
            "self_calibration": own,
            "gnss_correlation_s": None,
            "ins_correlation_s": None,
            "estimate_correlation": False,
        }
    )
    return project.model_copy(update={"adjustment": adjustment})
