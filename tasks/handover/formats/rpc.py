"""``NAME_RPC.TXT`` next to each image: what GDAL, QGIS, ArcGIS, ERDAS, Catalyst, OTB and SNAP read."""

from __future__ import annotations

from adjust.handover.rational import TERMS, RationalPolynomials
from tasks.handover.delivery import Delivery, Files
from tasks.handover.formats.short_names import stems


def write_rpc(delivery: Delivery) -> Files:
    """One file for each image."""
    names = stems(delivery.names)
    return {
        f"{name}_RPC.TXT": rpc_text(one, float(misfit))
        for name, one, misfit in zip(
            names, delivery.handed.polynomials, delivery.handed.misfit_px, strict=True
        )
    }


def rpc_text(one: RationalPolynomials, misfit_px: float) -> str:
    """The text of one file; the misfit is that of the polynomials to the camera, pixels."""
    values: dict[str, float] = {"ERR_BIAS": -1.0, "ERR_RAND": misfit_px}
    image, ground = ("LINE", "SAMP"), ("LAT", "LONG", "HEIGHT")
    values |= {f"{name}_OFF": float(value) for name, value in zip(image, one.image_offset, strict=True)}
    values |= {f"{name}_OFF": float(value) for name, value in zip(ground, one.ground_offset, strict=True)}
    values["LONG_OFF"] -= 360.0 * round(values["LONG_OFF"] / 360.0)
    values |= {f"{name}_SCALE": float(value) for name, value in zip(image, one.image_scale, strict=True)}
    values |= {f"{name}_SCALE": float(value) for name, value in zip(ground, one.ground_scale, strict=True)}
    for k, name in enumerate(image):
        for part, coefficients in (("NUM", one.numerator[k]), ("DEN", one.denominator[k])):
            values |= {f"{name}_{part}_COEFF_{i + 1}": float(coefficients[i]) for i in range(TERMS)}
    return "".join(f"{name}: {value:.15g}\n" for name, value in values.items())
