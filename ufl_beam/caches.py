# SPDX-License-Identifier: MIT
"""Caches of forms and of results that depend only on structure, and garbage collection.

Sparsity patterns and orders of elimination depend only on the connectivity of a scene: the
structure.  Scenes that differ only in numbers, such as the members of a study, have the same
structure.  The results for a structure are computed once.  So are the contacts of beams, which also
depend on coordinates.  Simulations with and without the cache agree in every bit, because all other
results are computed for each scene.
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

SMALL, LARGE = 2**16, 2**21
"""Largest sizes of the arguments of cached results: bytes of arrays plus values of whole numbers.

Scenes of about 500 cells exceed the first size, scenes of about 14 000 cells the second.
"""

MOST_SMALL, MOST_LARGE = 64, 4
"""Largest numbers of cached results of each function; several large ones serve derivatives."""


def cached_forms(function: Callable[P, Cached]) -> Callable[P, Cached]:
    """Cache the results of a function that builds forms, in each process, by its arguments."""
    return cast("Callable[P, Cached]", lru_cache(maxsize=128)(function))


def cached_by_structure(function: Callable[..., T]) -> Callable[..., T]:
    """Cache the results of a function of arrays and whole numbers, by its arguments.

    The function must depend only on its arguments and return a tuple of arrays.  The arrays become
    read-only, because callers share them.
    """

    def locked(result: T) -> T:
        for x in result:
            x.flags.writeable = False
        return result

    def compute(*keys: Any) -> T:
        # The key of an array is its type, shape and bytes, because arrays have no hash.
        arguments = (
            np.frombuffer(key[2], key[0]).reshape(key[1]) if isinstance(key, tuple) else key
            for key in keys
        )
        return locked(function(*arguments))

    small, large = (lru_cache(maxsize=most)(compute) for most in (MOST_SMALL, MOST_LARGE))

    @wraps(function)
    def call(*arguments: Any) -> T:
        keys, size = list[Any](), 0
        for x in arguments:
            is_array = isinstance(x, np.ndarray)
            size += x.nbytes if is_array else x
            if size > LARGE:
                return locked(function(*arguments))
            keys.append((x.dtype, x.shape, x.tobytes()) if is_array else x)
        return (small if size <= SMALL else large)(*keys)

    return call


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Suspend automatic garbage collection, as a context or a decorator.

    The collector examines all objects repeatedly while their number grows.  This would take a tenth
    of the time in which a scene of 100 000 beams is built.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
