"""The datum of a free network, as figures and in sentences."""

from __future__ import annotations

from adjust.result import AdjustmentResult
from tasks.files.json_text import JSON
from tasks.results.figures import FreeNetworkFigure

_WORDS = {
    "object_points": "object points",
    "projection_centres": "projection centres",
    "both": "object points and projection centres",
}


def free_network_figures(result: AdjustmentResult) -> JSON:
    """Which directions of the datum are open, and which approximate values fix them; null if not free."""
    free = result.free_network
    if free is None:
        return None
    return FreeNetworkFigure(
        inner_constraints=free.constrained, defect=free.defect, open=tuple(map(str, free.directions))
    ).to_json()


def free_network_sentences(result: AdjustmentResult) -> list[str]:
    """What the user should know about coordinates whose datum is that of approximate values."""
    free = result.free_network
    if free is None:
        return []
    if free.defect == 0:
        return [
            "A free network was requested (adjustment.datum), but the observations determine the whole "
            "datum: the result is an ordinary adjustment."
        ]
    listed = ", ".join(str(direction) for direction in free.directions)
    number = "1 direction" if free.defect == 1 else f"{free.defect} directions"
    return [
        f"Free network: the observations do not determine {number} of the datum ({listed}). The approximate "
        f"values of the {_WORDS[free.constrained]} fix them (minimum norm of the corrections). In these "
        "directions, coordinates, differences at check points and their standard deviations have no meaning "
        "outside the block; residuals and redundancy numbers do not depend on them."
    ]
