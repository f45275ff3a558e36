"""The calibration certificates of the eight heads of a DMC as they are printed (protocol DMC01-0008 of 2010).

Seven tables are headed "mm" and hold metres; that of 00114304 is headed "m". All that is not eliminated is
printed as significant, in that of 00114304 without any decision.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from tasks.files.toml_text import toml_text

Printed: TypeAlias = Mapping[str, list[float] | str]

PAN = ("00110011", "00110023", "00110036", "00110034")
#: Head without printed decisions, and in metres.
RED = "00114304"

PRINTED: Mapping[str, Printed] = {
    "00110011": {
        "dxp": [-0.0002706, 1.186e-05],
        "dyp": [0.0001016, 7.201e-06],
        "dc": [-0.0003158, 1.424e-06],
        "K1": [0.6164, 0.02083],
        "K2": [-365.3, 7.988],
        "K3": "eliminated",
        "P1": [-0.0008041, 0.0002703],
        "P2": [0.0008834, 0.0001369],
        "b1": "eliminated",
        "b2": [-4.486e-05, 8.369e-06],
    },
    "00110023": {
        "dxp": [0.0001001, 2.259e-06],
        "dyp": [0.0001835, 7.867e-06],
        "dc": [-0.0003974, 1.893e-06],
        "K1": [0.6577, 0.02437],
        "K2": [-399.3, 9.275],
        "K3": "eliminated",
        "P1": "eliminated",
        "P2": [0.0004227, 0.0001487],
        "b1": [-5.227e-05, 1.781e-05],
        "b2": [5.187e-05, 9e-06],
    },
    "00110036": {
        "dxp": [0.0002106, 2.533e-06],
        "dyp": [0.0001919, 5.104e-06],
        "dc": [-0.0002485, 1.742e-06],
        "K1": [0.6208, 0.02553],
        "K2": [-380.2, 9.813],
        "K3": "eliminated",
        "P1": "eliminated",
        "P2": "eliminated",
        "b1": "eliminated",
        "b2": [2.513e-05, 1.011e-05],
    },
    "00110034": {
        "dxp": [-8.946e-06, 2.176e-06],
        "dyp": [0.0002683, 7.62e-06],
        "dc": [-0.0002471, 1.833e-06],
        "K1": [0.6582, 0.02358],
        "K2": [-396.7, 8.972],
        "K3": "eliminated",
        "P1": "eliminated",
        "P2": [0.000806, 0.0001439],
        "b1": [-8.662e-05, 1.725e-05],
        "b2": "eliminated",
    },
    "00109982": {
        "dxp": [-0.0001684, 2.151e-06],
        "dyp": [3.856e-05, 1.551e-06],
        "dc": [2.436e-05, 9.797e-07],
        "K1": [-142.0, 0.5639],
        "K2": [215400.0, 2447.0],
        "K3": [-128300000.0, 3074000.0],
        "P1": [-0.004606, 0.001115],
        "P2": [-0.01466, 0.0006839],
        "b1": [6.549e-05, 3.024e-05],
        "b2": [4.532e-05, 1.742e-05],
    },
    "00109998": {
        "dxp": [4.274e-05, 2.89e-06],
        "dyp": [-5.789e-06, 2.081e-06],
        "dc": [-1.993e-05, 1.208e-06],
        "K1": [-138.4, 0.7536],
        "K2": [207500.0, 3272.0],
        "K3": [-126300000.0, 4099000.0],
        "P1": [0.006538, 0.001499],
        "P2": [-0.007727, 0.000918],
        "b1": "eliminated",
        "b2": "eliminated",
    },
    "00114304": {
        "dxp": [-9.891e-05, 1.416e-06],
        "dyp": [0.0001593, 9.998e-07],
        "dc": [-3.174e-05, 5.24e-07],
        "K1": [-138.6, 0.4406],
        "K2": [219800.0, 2810.0],
        "K3": [-145600000.0, 5058000.0],
        "P1": [6.054e-05, 0.0007361],
        "P2": [0.0006945, 0.0004569],
        "b1": [0.0001468, 1.296e-05],
        "b2": [-3.375e-05, 1.048e-05],
    },
    "00109992": {
        "dxp": [8.055e-06, 6.883e-07],
        "dyp": [5.556e-05, 1.983e-06],
        "dc": [-7.767e-05, 1.258e-06],
        "K1": [-137.8, 0.7242],
        "K2": [206300.0, 3143.0],
        "K3": [-121600000.0, 3948000.0],
        "P1": "eliminated",
        "P2": [-0.009712, 0.0008745],
        "b1": [0.0001085, 3.882e-05],
        "b2": "eliminated",
    },
}


def certificate(serial: str, unit: str = "mm", **changes: object) -> str:
    """The file of a head, with the unit it is headed with."""
    is_pan = serial in PAN
    head = {
        "serial": serial,
        "columns": 7168 if is_pan else 3072,
        "rows": 4096 if is_pan else 2048,
        "pixel_um": 12.0,
        "nominal_focal_length_mm": 120.0 if is_pan else 25.0,
        "unit": unit,
    }
    return toml_text({"head": head, "parameters": {**PRINTED[serial], **changes}})  # type: ignore[dict-item]
