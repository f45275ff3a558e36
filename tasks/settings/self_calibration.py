"""Settings of self-calibration: which additional parameters, for which entities, priors, selection."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator

from adjust.camera.additional.register import REGISTER
from adjust.camera.additional.selection import NOTHING, selected
from adjust.errors import AdditionalParametersError, ExtensionError
from tasks.settings.base import Settings, trouble
from tasks.settings.coordinates import Positive


def _known_selection(text: str) -> str:
    """A selection the register can read."""
    try:
        selected(text, REGISTER)
    except ExtensionError as error:
        raise trouble(str(error), "Repair that package, or use another set.") from error
    except AdditionalParametersError as error:
        raise trouble(
            f"The additional parameters '{text}' are not known: {error}",
            'Write for example "bluh:1-12"; docs/additional-parameters.md lists all sets.',
        ) from error
    return text.strip()


Selection: TypeAlias = Annotated[str, AfterValidator(_known_selection)]


class SelfCalibrationSettings(Settings):
    """Self-calibration by additional parameters."""

    parameters: Selection = NOTHING
    """Additional parameters to estimate, e.g. `"bluh:1-12"`, `"bluh:1-12+42-73+81-88"`, `"brown:K1,K2"`,
    `"brown-forward:k1-k3,p1,p2"`, `"legendre(5)"`; `"none"` for none. Focal length and principal point are
    listed in `free`.
    """
    per: Literal["camera", "flight"] = "camera"
    """Whether each `camera` has its own set, or each camera in each `flight`. With `flight`, a test shows
    whether the sets differ.
    """
    sigma_um: Positive | None = None
    """Standard deviation of each parameter about its given value, expressed as its largest effect in the
    image, µm. Default: no prior.
    """
    elimination: Literal["default", "bluh", "dmc_certificate", "none"] = "default"
    """Rule by which parameters that are not significant, or not separable from others, are eliminated one
    after another: `default` (correlation 0.90, total correlation 0.975, t of 99 %), `bluh` (t below 1,
    correlations above 0.85), `dmc_certificate` (t below 1.96), or `none`.
    """
