"""Tests of merging the visitors of several edges."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from enliven.person import Body
from enliven_viewer.kiosk.visitor_merge import SAME_VISITOR_M, VisitorMerge
from enliven_viewer.live.followed_edge import find_shared_performer_id, split_performer_id

PLACES = st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0))
EDGES = st.lists(st.lists(PLACES, max_size=4), min_size=1, max_size=3)


def bodies_at(places: list[tuple[float, float]]) -> list[Body]:
    """Returns bodies with the ids 1, 2, ... whose hips are at floor positions."""
    return [Body(k, np.tile([x, 1.0, z], (20, 1)), np.ones(20)) for k, (x, z) in enumerate(places, 1)]


@given(EDGES)
def test_no_visitor_is_lost_and_each_edge_counts_people_apart(edges):
    seen = {n: bodies_at(places) for n, places in enumerate(edges)}
    merged = VisitorMerge().merge(seen, set())
    assert max(map(len, edges)) <= len(merged) <= sum(map(len, edges))
    for number, body in merged.items():
        edge, own = split_performer_id(number)
        assert body.id == number and np.array_equal(body.joints, seen[edge][own - 1].joints)
    for n, there in seen.items():
        for body in there:
            near = [
                other
                for number, other in merged.items()
                if number == find_shared_performer_id(n, body.id)
                or np.linalg.norm(other.joints[0] - body.joints[0]) <= SAME_VISITOR_M
            ]
            assert near, "a body is only left out for another one at its place"


@given(EDGES)
def test_the_same_frame_again_changes_nothing(edges):
    seen = {n: bodies_at(places) for n, places in enumerate(edges)}
    merge = VisitorMerge()
    assert merge.merge(seen, set()).keys() == merge.merge(seen, set()).keys()


@given(EDGES, st.data())
def test_a_body_that_holds_a_character_stays(edges, data):
    seen = {n: bodies_at(places) for n, places in enumerate(edges)}
    everyone = [find_shared_performer_id(n, body.id) for n, there in seen.items() for body in there]
    holding = data.draw(st.sets(st.sampled_from(everyone)) if everyone else st.just(set()))
    assert holding <= VisitorMerge().merge(seen, holding).keys()


def test_a_visitor_keeps_the_edge_that_saw_them_first():
    merge = VisitorMerge()
    second = find_shared_performer_id(1, 1)
    assert merge.merge({0: [], 1: bodies_at([(0.0, 0.0)])}, set()).keys() == {second}
    for x in (0.1, 0.3, 0.5, 0.3):
        both = {0: bodies_at([(x, 0.0)]), 1: bodies_at([(0.0, 0.0)])}
        assert merge.merge(both, set()).keys() == {second}, "a small distance does not split them"
    apart = {0: bodies_at([(1.0, 0.0)]), 1: bodies_at([(0.0, 0.0)])}
    assert merge.merge(apart, set()).keys() == {1, second}
    assert merge.merge({0: bodies_at([(0.0, 0.0)]), 1: []}, set()).keys() == {1}


def test_a_body_without_known_hips_is_nobodys_double():
    unknown = Body(1, np.full((20, 3), np.nan), np.zeros(20))
    assert len(VisitorMerge().merge({0: [unknown], 1: [unknown]}, set())) == 2
