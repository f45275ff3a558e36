"""What an alternative of the model is about, as tables name it, and from which size it is found."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from statistics import NormalDist

from tasks.quantities import quantity_words

#: Beyond the critical value, in σ: what is found with a probability of 80 %.
POWER = NormalDist().inv_cdf(0.8)
#: Beginning of a quantity: the given value of the parameter that follows.
PRIOR = "prior_"
#: What is wrong as a whole or not at all, and the part of it below which it is not wrong.
WHOLE, LEAST_PART = ("convergence", "angle_order", "distortion_direction", "distortion_sign"), 0.3
#: So many σ beyond the sizes it could have, something is certainly not the cause.
CERTAIN = 3.0
_SINGLE = ("gnss_position_", "ins_attitude_", "control_point_")


def alternative_words(row: Mapping[Hashable, object]) -> str:
    """The subject of a row of model_alternatives.parquet: ``GNSS shift z at the height 780 m``."""
    return f"{quantity_words(str(row['quantity']))}{where(str(row['scope']), str(row['part']))}"


def alike_words(row: Mapping[Hashable, object]) -> str:
    """The same where other causes are listed; with the image or point of a single observation."""
    is_single = str(row["quantity"]).startswith(_SINGLE)
    return f"{alternative_words(row)} of {row['entity']}" if is_single else alternative_words(row)


def where(scope: str, part: str) -> str:
    """In which part of the block an alternative applies; empty: in all of it."""
    return {
        "all": "",
        "flight": f" in flight {part}",
        "height": f" at the height {part}",
        "direction": f" in the direction {part}",
        "strip": f" in strip {part}",
    }[scope]
