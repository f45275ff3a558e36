"""The first of two steps: the settings of an adjustment without GNSS and INS."""

from __future__ import annotations

from adjust.camera.additional.selection import NOTHING
from tasks.settings.project import Project


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
