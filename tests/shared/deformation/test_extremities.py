"""Tests of finding the ends of limbs: a star's arms, a hand's fingers, several shells, any size."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.deformation.graph.surface_ends import (
    MAX_SMALL_SHELL_POINTS,
    find_extremity_vertices,
    find_local_maxima,
    shell_connections,
)
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh, refine


def star(lengths, cells=4, gap=0.0):
    """Returns bars of square section that point outwards, joined to one solid, or separate ones if there is a
    gap.
    """
    parts, faces, count = [], [], 0
    for k, length in enumerate(lengths):
        turn = 2 * np.pi * k / len(lengths)
        along = np.array([np.cos(turn), np.sin(turn), 0.0])
        across = np.array([-np.sin(turn), np.cos(turn), 0.0])
        rings = np.linspace(0.1 + gap, length, cells * 6)
        corners = 0.05 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        points = np.array(
            [[r * along + c[0] * across + [0, 0, c[1]] for c in corners] for r in rings]
        ).reshape(-1, 3)
        for r in range(len(rings) - 1):
            for c in range(4):
                a, b = 4 * r + c, 4 * r + (c + 1) % 4
                faces += [[count + a, count + b, count + a + 4], [count + b, count + b + 4, count + a + 4]]
        last = count + 4 * (len(rings) - 1)
        faces += [[last, last + 1, last + 2], [last, last + 2, last + 3]]
        faces += [[count, count + 2, count + 1], [count, count + 3, count + 2]]
        parts.append(points)
        count += len(points)
    hub = len(lengths)
    if not gap:
        ring = [4 * len(p) // 4 for p in parts]
        starts = np.concatenate([[0], np.cumsum(ring)])[:hub]
        for side in (0, 2):
            middle = count
            parts.append(np.array([[0.0, 0.0, -0.05 if side == 0 else 0.05]]))
            count += 1
            for k in range(hub):
                a, b = int(starts[k]) + (0 if side == 0 else 3), int(starts[k]) + (1 if side == 0 else 2)
                c = int(starts[(k + 1) % hub]) + (0 if side == 0 else 3)
                faces += [[middle, a, b], [middle, b, c]]
    return Mesh(np.concatenate(parts), np.array(faces, np.int32), "star")


@pytest.mark.parametrize("count", [3, 5, 7])
@pytest.mark.parametrize("gap", [0.0, 0.02])
def test_the_ends_of_a_star_are_its_arms_longest_first(count, gap):
    lengths = np.linspace(1.0, 0.6, count)
    mesh = star(lengths, gap=gap)
    ends = find_extremity_vertices(mesh)
    radius = np.linalg.norm(mesh.vertices[ends], axis=1)
    arms = np.round(np.arctan2(*mesh.vertices[ends].T[1::-1]) / (2 * np.pi / count)).astype(int) % count
    assert sorted(arms[:count]) == list(range(count))
    assert (radius[:count] > 0.93 * lengths[arms[:count]]).all()
    assert arms[0] in (0, 1, count - 1)
    assert find_extremity_vertices(mesh, 2).tolist() == ends[:2].tolist()


def test_a_finer_mesh_has_the_same_ends():
    mesh = star([1.0, 0.9, 0.8, 0.7])
    fine = refine(mesh, 0.01)
    assert len(fine.vertices) > 10 * len(mesh.vertices)
    coarse_ends, fine_ends = (
        mesh.vertices[find_extremity_vertices(mesh, 4)],
        fine.vertices[find_extremity_vertices(fine, 4)],
    )
    distances = np.linalg.norm(coarse_ends[:, None] - fine_ends, axis=2)
    assert (distances.min(0) < 0.12).all() and (distances.min(1) < 0.12).all()


def test_loose_vertices_are_no_ends():
    mesh = star([1.0, 0.8, 0.8])
    loose = np.random.default_rng(3).normal(0.0, 9.0, (3000, 3))
    more = Mesh(np.concatenate([mesh.vertices, loose]), mesh.faces)
    assert find_extremity_vertices(more).tolist() == find_extremity_vertices(mesh).tolist()


@pytest.mark.slow
@settings(max_examples=40)
@given(st.integers(0, 10**6), st.sampled_from([(1, 4), (30, 1), (30, 3), (5, 2 * MAX_SMALL_SHELL_POINTS)]))
def test_shells_are_joined_by_the_shortest_pairs_that_make_them_one(seed, sizes):
    """As the obvious way joins them: of all pairs of shells the nearest one that is not one piece yet."""
    chance, (shells, largest) = np.random.default_rng(seed), sizes
    label = np.concatenate([np.full(n, k) for k, n in enumerate(chance.integers(1, largest + 1, shells))])
    points = chance.normal(size=(len(label), 3)) + 4.0 * chance.normal(size=(shells, 3))[label]
    joints = shell_connections(points, label)
    between = np.linalg.norm(points[:, None] - points, axis=2)
    piece, expected = label.copy(), 0.0
    for a, b in zip(*np.unravel_index(np.argsort(between, axis=None), between.shape), strict=True):
        if piece[a] != piece[b]:
            piece[piece == piece[a]], expected = piece[b], expected + between[a, b]
        if (piece == piece[0]).all():
            break
    assert len(joints) == shells - 1
    # Two sums of the same lengths in another order.
    assert between[joints[:, 0], joints[:, 1]].sum() == pytest.approx(expected, rel=1e-12)
    piece = label.copy()
    for a, b in joints:
        piece[piece == piece[a]] = piece[b]
    assert (piece == piece[0]).all()


def test_peaks_stand_over_their_passes():
    # Heights along a line: a peak of 5, a pass of 2, a peak of 4, a pass of 1, a peak of 3.
    height = np.array([0.0, 5.0, 2.0, 4.0, 1.0, 3.0, 0.5])
    count = len(height)
    offsets = np.concatenate([[0], np.cumsum([1] + [2] * (count - 2) + [1])]).astype(np.int32)
    neighbours = np.array([1, 0, 2, 1, 3, 2, 4, 3, 5, 4, 6, 5], np.int32)
    tips, over = find_local_maxima(offsets, neighbours, height, np.argsort(-height))
    assert dict(zip(tips.tolist(), over.tolist(), strict=True)) == {1: 5.0, 3: 2.0, 5: 2.0}


def test_without_area_there_is_nothing_to_find():
    with pytest.raises(InputError):
        find_extremity_vertices(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32)))
