"""Tell the user why the first run takes longer."""

from __future__ import annotations

import logging

from adjust import compiled

_log = logging.getLogger("aerocal")


def announce_compilation() -> None:
    """Say that kernels are about to be compiled, if this version has not been used on this machine yet."""
    if not compiled.is_warm():
        _log.info("first run with this version: compiling, some 20 s once")
