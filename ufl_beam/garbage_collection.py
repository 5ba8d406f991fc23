# SPDX-License-Identifier: MIT
"""Garbage collection, left aside where many objects are made that stay."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Suspend automatic garbage collection; also a decorator.

    It looks at all objects again and again while their number grows: a tenth of the time in which a
    scene of 100 000 beams is built.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
