# SPDX-License-Identifier: MIT
"""Memory: the cache of what scenes of one structure share, and garbage collection.

Sparsity patterns, chains and groups of nodes follow from the structure of a scene.  Scenes that
differ in numbers only, such as the members of a study, have the same structure.  What follows from
it is computed for the first of them; what follows from numbers is computed for each, so that a
simulation is to the last bit what it would be alone.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache, wraps
from typing import Any, ParamSpec, TypeVar, cast

import numpy as np

T = TypeVar("T", bound=tuple[Any, ...])
P = ParamSpec("P")
Cached = TypeVar("Cached")

MOST_CACHED = 64
"""Results that are kept of each function."""

LARGEST = 2**16
"""Bytes of arguments, or size that they state, beyond which results are not kept.

That are some 500 cells, of which a hundred steps take longer than all of the building.
"""


def cached_forms(function: Callable[P, Cached]) -> Callable[P, Cached]:
    """Call a function that states forms once in a process with the same arguments."""
    return cast("Callable[P, Cached]", lru_cache(maxsize=128)(function))


def cached_by_structure(function: Callable[..., T]) -> Callable[..., T]:
    """Call a function of index arrays and whole numbers once with the same arguments.

    It sees nothing but the numbers in its arguments, and returns a tuple; nobody can write to the
    arrays in it, as others have them too.
    """

    def locked(result: T) -> T:
        for x in result:
            x.flags.writeable = False
        return result

    @lru_cache(maxsize=MOST_CACHED)
    def cached(*keys: Any) -> T:
        # Of an array the type, the shape and the bytes, which have a hash
        arguments = (
            np.frombuffer(key[2], key[0]).reshape(key[1]) if isinstance(key, tuple) else key
            for key in keys
        )
        return locked(function(*arguments))

    @wraps(function)
    def call(*arguments: Any) -> T:
        sizes = (x.nbytes if isinstance(x, np.ndarray) else x for x in arguments)
        if sum(sizes) > LARGEST:
            return locked(function(*arguments))
        keys = (
            (x.dtype.str, x.shape, x.tobytes()) if isinstance(x, np.ndarray) else x
            for x in arguments
        )
        return cached(*keys)

    return call


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
