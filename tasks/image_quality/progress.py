"""Progress of an examination of images, in tenths, for the log and the progress line of a terminal."""

from __future__ import annotations

import logging
from dataclasses import dataclass, field

_log = logging.getLogger("aerocal")
_TENTHS = 10


@dataclass
class Progress:
    """Progress of a part of a stage.

    Attributes
    ----------
    name : of the part, e.g. the file.
    start, share : fraction of the stage before it, and of itself, 0 to 1.
    """

    name: str
    start: float = 0.0
    share: float = 1.0
    _told: int = field(default=0, init=False)

    def tell(self, done: float) -> None:
        """Report that this fraction of the part is done, if it is a tenth more than reported last."""
        tenths = int(_TENTHS * done + 1e-9)
        if tenths > self._told:
            self._told = tenths
            fraction = self.start + self.share * done
            _log.info("%s: %.0f %%", self.name, 100.0 * done, extra={"stage_fraction": fraction})
