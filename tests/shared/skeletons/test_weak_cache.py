"""Tests of the cache of functions of one immutable object."""

from __future__ import annotations

import gc
import weakref

from made_bodies import horse, man

from enliven.document import Skeleton
from enliven.skeletons.anatomy import find_anatomy
from enliven.skeletons.weak_cache import cache_while_alive


def test_each_object_is_computed_once() -> None:
    computed = []

    @cache_while_alive
    def count_joints(skeleton: Skeleton) -> int:
        computed.append(skeleton)
        return len(skeleton)

    first, second = horse(), horse()
    assert [count_joints(skeleton) for skeleton in (first, second, first, second)] == [len(first)] * 4
    assert computed == [first, second]


def test_the_cache_keeps_no_object_alive() -> None:
    skeleton = man()
    watched = weakref.ref(skeleton)
    assert find_anatomy(skeleton) is find_anatomy(skeleton)
    del skeleton
    gc.collect()
    assert watched() is None


def test_a_given_heading_is_not_replaced_by_the_cached_one() -> None:
    skeleton = man()
    assert find_anatomy(skeleton).facing != find_anatomy(skeleton, 1.0).facing == 1.0
