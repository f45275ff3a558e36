"""Words instead of names of the code: parameters, settings and tables in sentences of a certificate.

Reasons and remarks are written for who runs the program and name its settings; who reads a certificate has a
document only.
"""

from __future__ import annotations

import re

from tasks.documents.report.figures import gate_words
from tasks.quantities import COMPONENTS, KINDS, entity_kind, quantity_words
from tasks.settings.adjustment import AdjustmentSettings, Priors
from tasks.settings.cameras import CameraInput
from tasks.settings.direct_georeferencing import DirectGeoreferencingSettings
from tasks.settings.inputs import ControlInput, ExposureSigma
from tasks.settings.quality import ChecksSettings

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
    "adjustment.self_calibration": "self-calibration",
    "adjustment.refraction": "the correction for refraction",
    "mount_deg": "the mounting",
    "checks.min_intersection_angle_deg": "the minimum angle of intersection",
    "prior:": "initial values of the ",
    "calibration.held": "the σ of the parameters held fixed",
    "model_alternatives.parquet": "the tables of the results",
    "model_alternative_effects.parquet": "the table of their effects",
}
_QUANTITIES = sorted({*COMPONENTS, *KINDS}, key=len, reverse=True)
_NAMES = re.compile(
    "|".join(
        [*(re.escape(name) for name in sorted(_SETTINGS, key=len, reverse=True))]
        + [rf"\b{re.escape(name)}\b" for name in _QUANTITIES]
    )
)

# What belongs to a flight is named by it: "GNSS shift z of 1" reads like a number.
_OF_FLIGHT = re.compile(
    r"\b("
    + "|".join(quantity_words(name) for name in COMPONENTS if entity_kind(name) == "flight")
    + r") of (?!flight )(?=\S)"
)
# Beside expanded uncertainties a standard deviation does not stand behind ± (JCGM 100:2008, 7.2.2).
_NUMBER = r"\d[\d.,]*(?:e[+-]?\d+)?"
_SIGMA = re.compile(rf"([+−-]?{_NUMBER})°? ± ({_NUMBER})( ?)(°|[^\s.,;)]+)")
# A setting without words of its own is called by its last key.
_OTHER_SETTING = re.compile(
    r"\b(?:adjustment|calibration|checks|direct_georeferencing|gates)\.[\w.]*?(\w+)\b"
)
_KEYS = sorted(
    {
        name
        for table in (
            AdjustmentSettings,
            CameraInput,
            ChecksSettings,
            ControlInput,
            DirectGeoreferencingSettings,
            ExposureSigma,
            Priors,
        )
        for name in table.model_fields
        if "_" in name
    },
    key=len,
    reverse=True,
)
_KEY = re.compile(rf"\b(?:{'|'.join(_KEYS)})\b")
_UNIT = re.compile(r"_(?:um|mm|m|deg|s|px)$")
_GATE = re.compile(r"\bThe gate (\w+) failed\b")
#: What x, y and z are of.
AXES_NOTE = (
    "x, y, z: for GNSS and control east, north, up; for the lever arm forward, right, down; for the "
    "principal point along columns and opposite to rows."
)


def in_words(sentence: str) -> str:
    """A sentence with words instead of names of the code."""
    plain = _GATE.sub(lambda found: f"The limit for {gate_words(found[1])} is not met", sentence)
    plain = _NAMES.sub(lambda found: _SETTINGS.get(found[0], quantity_words(found[0])), plain)
    plain = _OTHER_SETTING.sub(lambda found: _key_words(found[1]), plain)
    plain = _KEY.sub(lambda found: _key_words(found[0]), plain).replace("`", "")
    return _SIGMA.sub(r"\1\3\4 (σ \2\3\4)", _OF_FLIGHT.sub(r"\1 of flight ", plain))


def _key_words(key: str) -> str:
    """A key of the project file without its unit."""
    return _UNIT.sub("", key).replace("_", " ")
