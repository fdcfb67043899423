"""A cache for functions of one immutable object. It does not keep the objects alive.

@cache_while_alive
def find_anatomy(skeleton: Skeleton) -> Anatomy: ...
"""

from __future__ import annotations

import functools
import weakref
from collections.abc import Callable
from typing import TypeVar

K = TypeVar("K")
V = TypeVar("V")


def cache_while_alive(function: Callable[[K], V]) -> Callable[[K], V]:
    """Returns the function with a cache. A result is dropped as soon as its argument is no longer used.

    Arguments are compared by identity, so their class must not define another equality. The result must not
    refer to the argument, because then both would stay in memory.
    """
    results = weakref.WeakKeyDictionary[K, V]()

    @functools.wraps(function)
    def cached(argument: K) -> V:
        try:
            return results[argument]
        except KeyError:
            return results.setdefault(argument, function(argument))

    return cached
