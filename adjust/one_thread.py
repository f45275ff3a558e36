"""The linear algebra on one thread: our own threads, and processes beside this one, share the processors."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache
from typing import cast

# Loads the libraries that are limited.
import scipy.linalg  # noqa: F401
from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[object]:
    """Limit the libraries of the linear algebra to one thread each while the context lasts."""
    return cast(AbstractContextManager[object], _libraries().limit(limits=1))


@cache
def _libraries() -> ThreadpoolController:
    """What is loaded; looking for it takes milliseconds each time."""
    return ThreadpoolController()
