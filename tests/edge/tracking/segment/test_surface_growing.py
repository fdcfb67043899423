"""Tests that only connected pixels are returned to a person, compared with a slow flood fill."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from enliven_edge.tracking.segment.surface_growing import grow_surfaces, reassign_detached_pieces

PEOPLE = 3
SHAPE = (14, 18)
SCENES = st.integers(0, 100_000)


def scene(seed: int, people: int = PEOPLE) -> tuple[np.ndarray, np.ndarray]:
    """Returns (owner, z) of patches of people that partly occlude or almost touch each other, and stray
    pixels.
    """
    random = np.random.default_rng(seed)
    owner, z = np.full(SHAPE, -1), 2.0 + 0.01 * random.standard_normal(SHAPE)
    for _ in range(random.integers(2, 9)):
        top, left = random.integers(0, SHAPE[0]), random.integers(0, SHAPE[1])
        patch = np.s_[top : top + random.integers(1, 9), left : left + random.integers(1, 9)]
        owner[patch] = random.integers(-1, people)
        z[patch] += random.choice([0.0, 0.0, 0.3, 0.083])
    astray = random.random(SHAPE) < random.choice([0.0, 0.05])
    owner[astray] = random.integers(-1, people, astray.sum())
    return owner, z


def after(owner: np.ndarray, z: np.ndarray, people: int = PEOPLE) -> tuple[np.ndarray, np.ndarray]:
    """Returns (owner, counts) after detached pixels were returned."""
    returned = owner.copy()
    counts = reassign_detached_pieces(returned, z, np.bincount(owner[owner >= 0], minlength=people))
    return returned, counts


def neighbours(owner: np.ndarray, z: np.ndarray) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """Returns, for each person pixel, the neighbouring person pixels on the same surface."""
    adjacent = {(v, u): [] for v, u in product(*map(range, z.shape)) if owner[v, u] >= 0}
    for v, u in adjacent:
        for before in ((v - 1, u), (v, u - 1)):
            if before in adjacent and abs(z[v, u] - z[before]) < 0.035 + 0.012 * z[v, u] * z[before]:
                adjacent[v, u].append(before)
                adjacent[before].append((v, u))
    return adjacent


def pieces(owner: np.ndarray, beside) -> list[set[tuple[int, int]]]:
    """Returns connected regions of one owner each, in reading order of their first pixel."""
    components, done = [], set()
    for start in beside:
        if start in done:
            continue
        piece, edge = {start}, [start]
        while edge:
            pixel = edge.pop()
            new = [p for p in beside[pixel] if owner[p] == owner[start] and p not in piece]
            piece.update(new)
            edge.extend(new)
        done |= piece
        components.append(piece)
    return components


def largest(owner: np.ndarray, z: np.ndarray, people: int = PEOPLE) -> list[set[tuple[int, int]]]:
    """Returns each person's largest region, empty for a person without pixels."""
    parts = pieces(owner, neighbours(owner, z))
    theirs = [[part for part in parts if owner[min(part)] == k] for k in range(people)]
    return [max(each, key=len, default=set()) for each in theirs]


def slowly(owner: np.ndarray, z: np.ndarray, people: int = PEOPLE) -> np.ndarray:
    """Computes the owners region by region."""
    beside, main = neighbours(owner, z), largest(owner, z, people)
    returned = owner.copy()
    for piece in pieces(owner, beside):
        whose = owner[min(piece)]
        contacts = [sum(p in main[k] for place in piece for p in beside[place]) for k in range(people)]
        contacts[whose] = 0
        other = int(np.argmax(contacts))
        if piece != main[whose] and contacts[other] >= 3 and len(piece) < 0.4 * len(main[other]):
            for pixel in piece:
                returned[pixel] = other
    return returned


@given(SCENES)
@settings(max_examples=150, deadline=None)
@pytest.mark.slow
def test_result_matches_flood_fill(seed):
    owner, z = scene(seed)
    np.testing.assert_array_equal(after(owner, z)[0], slowly(owner, z))


def test_scenes_contain_detached_pixels():
    changed = [not np.array_equal(after(*scene(seed))[0], scene(seed)[0]) for seed in range(100)]
    assert 10 < sum(changed) < 90


@given(SCENES)
@settings(max_examples=60, deadline=None)
def test_every_pixel_is_still_counted_once(seed):
    owner, z = scene(seed)
    returned, counts = after(owner, z)
    np.testing.assert_array_equal(counts, np.bincount(returned[returned >= 0], minlength=PEOPLE))
    np.testing.assert_array_equal(returned < 0, owner < 0)


@given(SCENES)
@settings(max_examples=60, deadline=None)
def test_everyone_keeps_their_largest_piece(seed):
    owner, z = scene(seed)
    returned, _ = after(owner, z)
    for k, piece in enumerate(largest(owner, z)):
        assert all(returned[pixel] == k for pixel in piece)


@given(SCENES)
@settings(max_examples=30, deadline=None)
def test_single_person_keeps_all_pixels(seed):
    owner, z = scene(seed, 1)
    returned, counts = after(owner, z, 1)
    np.testing.assert_array_equal(returned, owner)
    assert counts.tolist() == [(owner == 0).sum()]


@given(SCENES)
@settings(max_examples=30, deadline=None)
def test_person_without_surface_contact_keeps_all_pixels(seed):
    owner, z = scene(seed)
    z = z + 5.0 * owner
    np.testing.assert_array_equal(after(owner, z)[0], owner)


def two_with_an_arm(touch: int, away: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns (owner, z, arm): two blocks, and the detached arm of the first block.

    Args:
        touch: number of pixels at which the arm touches the second block.
        away: distance of the arm behind that block, metres.
    """
    owner, z = np.full((20, 40), -1), np.full((20, 40), 2.0)
    owner[:, :10], owner[:, 25:] = 0, 1
    arm = np.zeros(owner.shape, bool)
    arm[:touch, 17:25] = True
    owner[arm], z[arm] = 0, 2.0 + away
    return owner, z, arm


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("touch", [3, 4, 8])
def test_arm_connected_with_the_other_person_is_given_to_them(touch, mirrored):
    owner, z, arm = two_with_an_arm(touch)
    if mirrored:
        owner, z, arm = (np.ascontiguousarray(each[::-1, ::-1]) for each in (owner, z, arm))
    returned, counts = after(owner, z, 2)
    assert (returned[arm] == 1).all()
    np.testing.assert_array_equal(returned[~arm], owner[~arm])
    assert counts.tolist() == [200, 300 + arm.sum()]


def test_arm_with_little_contact_keeps_its_owner():
    owner, z, _ = two_with_an_arm(2)
    np.testing.assert_array_equal(after(owner, z, 2)[0], owner)


def test_an_arm_across_a_depth_edge_from_the_other_stays():
    owner, z, _ = two_with_an_arm(8, away=0.15)
    np.testing.assert_array_equal(after(owner, z, 2)[0], owner)


def test_an_arm_that_hangs_together_with_its_owner_stays():
    owner, z, _ = two_with_an_arm(8)
    owner[4, 10:17] = 0
    np.testing.assert_array_equal(after(owner, z, 2)[0], owner)


def test_large_piece_is_not_given_to_the_other_person():
    """A region of this size may be a person, even if another person's fit has captured a part of it."""
    owner, z, arm = two_with_an_arm(18)
    assert 0.4 * (owner == 1).sum() <= arm.sum()
    np.testing.assert_array_equal(after(owner, z, 2)[0], owner)


def test_person_without_pixels_gets_none():
    owner, z, arm = two_with_an_arm(8)
    returned, counts = after(owner, z, 3)
    assert (returned[arm] == 1).all() and counts[2] == 0


PLAIN = 0.1
"""Maximum distance from a person's surface at which a pixel clearly belongs to that person, metres."""


def contested(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Returns (owner, distance, z) of patches with some clear pixels, and the owner after growing."""
    owner, z = scene(seed)
    random = np.random.default_rng([seed, 1])
    distance = np.where(random.random(SHAPE) < 0.3, 0.02, 0.15)
    grown = owner.copy()
    grow_surfaces(grown, distance, z)
    return owner, distance, z, grown


def steps_from(sources: list[tuple[int, int]], beside) -> dict[tuple[int, int], int]:
    """Returns the number of steps along the surface to each reachable pixel."""
    steps, edge = dict.fromkeys(sources, 0), list(sources)
    for here in edge:
        for there in beside[here]:
            if there not in steps:
                steps[there] = steps[here] + 1
                edge.append(there)
    return steps


def is_contested(owner: np.ndarray, distance: np.ndarray, beside) -> bool:
    """Returns True if an unclear pixel of one person touches a pixel of another."""
    pairs = ((a, b) for a in beside for b in beside[a] if owner[a] != owner[b])
    return any(max(distance[a], distance[b]) > PLAIN for a, b in pairs)


@given(SCENES)
@example(6501)
@example(89)
@settings(deadline=None, max_examples=60)
def test_pixels_are_assigned_to_the_nearest_person_along_the_surface(seed):
    owner, distance, z, grown = contested(seed)
    beside = neighbours(owner, z)
    if not is_contested(owner, distance, beside):
        np.testing.assert_array_equal(grown, owner)
        return
    steps = [
        steps_from([p for p in beside if owner[p] == k and distance[p] <= PLAIN], beside)
        for k in range(PEOPLE)
    ]
    for pixel in beside:
        least = min(reach.get(pixel, np.inf) for reach in steps)
        if least == np.inf:
            assert grown[pixel] == owner[pixel]
        else:
            assert steps[grown[pixel]].get(pixel, np.inf) == least


@given(SCENES)
@settings(deadline=None, max_examples=60)
def test_clear_and_unowned_pixels_keep_their_owner(seed):
    owner, distance, _, grown = contested(seed)
    plain = (owner >= 0) & (distance <= PLAIN)
    np.testing.assert_array_equal(grown[plain], owner[plain])
    np.testing.assert_array_equal(grown < 0, owner < 0)


def test_held_hands_are_parted_in_the_middle():
    """Each has one arm, which is clear only at the shoulder. The person with the nearer fit claims both
    arms.
    """
    owner, distance = np.full((1, 20), 0), np.full((1, 20), 0.15)
    owner[0, 17:], distance[0, :3], distance[0, 17:] = 1, 0.0, 0.0
    grow_surfaces(owner, distance, np.full((1, 20), 2.0))
    assert (owner[0, :10] == 0).all() and (owner[0, 10:] == 1).all()
