"""Settings of the triangulation that ends a burn-in flight, and of its protocol."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator

from tasks.settings.adjustment import FreeParameter
from tasks.settings.base import Settings, one_of
from tasks.settings.published_sweep import published_protocols


class BurnInSettings(Settings):
    """The burn-in protocol of a camera with composed images, written by `aerocal calibrate`.

    The image points of the heads are transferred to the virtual images with the calibrated platform, and the
    block of the virtual images is triangulated.
    """

    free: tuple[FreeParameter, ...] = ("gnss_strip_bias", "gnss_drift", "ins_strip_bias", "ins_drift")
    """System parameters estimated in the triangulation; by default shift and drift of GNSS and INS in each
    strip.
    """
    compare_with: (
        Annotated[str, AfterValidator(one_of(published_protocols, "published burn-in protocol"))] | None
    ) = None
    """Published protocol to show next to the results."""
