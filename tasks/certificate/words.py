"""Words in the place of names of the code: parameters, settings and tables in sentences of a certificate.

Reasons and remarks are written for who runs the program and name its settings; who reads a certificate has a
document only.
"""

from __future__ import annotations

import re

from adjust.parameters import FAMILIES

_FAMILIES = {
    "boresight": "boresight misalignment",
    "lever_arm": "lever arm",
    "gnss_shift": "GNSS shift of each flight",
    "gnss_strip_bias": "GNSS bias of each strip",
    "gnss_drift": "GNSS drift of each strip",
    "time_offset": "time offset of each flight",
    "focal_length": "focal length",
    "principal_point": "principal point",
}
_AXES = {"x", "y", "z"}
# What is a setting, and its words; the longest first.
_SETTINGS = {
    "adjustment.variance_components = true": "variance components",
    "adjustment.variance_components": "variance components",
    "adjustment.ins_correlation_s": "correlation time of the INS errors",
    "ins_correlation_s": "correlation time of the INS errors",
    "adjustment.gnss_correlation_s": "correlation time of the GNSS errors",
    "gnss_correlation_s": "correlation time of the GNSS errors",
    "priors.gnss_strip_bias_m": "σ of the GNSS biases of strips",
    "adjustment.priors": "the σ of initial values",
    "adjustment.free": "what is estimated",
    "checks.min_intersection_angle_deg": "the least angle of rays",
    "calibration.held": "how well known what is held is",
    "model_alternatives.parquet": "the tables of the results",
    "model_alternative_effects.parquet": "the effects beside them",
}
_COMPONENTS = sorted(
    {c for family in FAMILIES.values() for c in family.components if "_" in c} | set(_FAMILIES),
    key=len,
    reverse=True,
)
_NAMES = re.compile(
    "|".join(
        [*(re.escape(name) for name in sorted(_SETTINGS, key=len, reverse=True))]
        + [rf"\b{re.escape(name)}\b" for name in _COMPONENTS]
    )
)


def parameter_family(name: str) -> str:
    """A family of system parameters in words."""
    return _FAMILIES.get(name, name.replace("_", " "))


def in_words(sentence: str) -> str:
    """A sentence with words in the place of names of the code."""
    return _NAMES.sub(lambda found: _SETTINGS.get(found[0], _component(found[0])), sentence)


def _component(name: str) -> str:
    return name.replace("gnss_", "GNSS ").replace("_", " ")


def entity_words(parameter: str, entity: str) -> str:
    """A parameter with what it is of: ``GNSS shift x of flight 1``, ``principal point x of UCE-80``."""
    of_flight = parameter.startswith(("gnss_", "time_offset"))
    of = f" of flight {entity}" if of_flight else f" of {entity}" if entity else ""
    return f"{_component(parameter)}{of}"
