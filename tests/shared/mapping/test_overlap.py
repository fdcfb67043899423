"""Tests of finding surface points inside another part of the body, against solid angles summed over all
faces.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document import Skeleton, SkinWeights, still_shape
from enliven.mapping.overlap import SelfIntersectionTest
from enliven.meshes import Mesh

PARTS = 4
"""Number of balls of the test body. The bones of the first two share a joint, and so do those of the last
two.
"""


def ball(rings=6, round_=8):
    """Returns a closed surface of radius 1 about the origin: its points (V, 3) and faces (F, 3)."""
    tilt = np.linspace(0.0, np.pi, rings + 1)[1:-1, None]
    turn = np.linspace(0.0, 2 * np.pi, round_, endpoint=False) + 0.1
    ring = np.stack([np.sin(tilt) * np.cos(turn), np.cos(tilt) + 0 * turn, np.sin(tilt) * np.sin(turn)], -1)
    points = np.concatenate([[[0, 1, 0]], ring.reshape(-1, 3), [[0, -1, 0]]])
    at = lambda r, k: 1 + r * round_ + k % round_  # noqa: E731
    faces = [[0, at(0, k + 1), at(0, k)] for k in range(round_)]
    for r in range(rings - 2):
        for k in range(round_):
            faces += [[at(r, k), at(r, k + 1), at(r + 1, k)], [at(r, k + 1), at(r + 1, k + 1), at(r + 1, k)]]
    last = len(points) - 1
    faces += [[last, at(rings - 2, k), at(rings - 2, k + 1)] for k in range(round_)]
    return points, np.array(faces, np.int32)


def balls(random):
    """Returns a body of separate balls, each on its own bone."""
    points, faces = ball()
    parents = np.array([-1, 0, 0, 1, 3], np.int32)
    names = ("root", "a", "b", "c", "d")
    places = np.array([[0.0, 0, 0], [1, 0, 0], [-1, 0, 0], [2, 0, 0], [3, 0, 0]])
    sizes = random.uniform(0.3, 1.0, (PARTS, 3))
    vertices = np.concatenate([points * size + [6.0 * k, 0, 0] for k, size in enumerate(sizes)])
    whole = np.concatenate([faces + k * len(points) for k in range(PARTS)])
    indices = np.zeros((len(vertices), 4), np.uint16)
    indices[:, 0] = np.repeat(np.arange(1, PARTS + 1), len(points))
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(vertices), 1))
    mesh = Mesh(vertices, whole.astype(np.int32), "balls")
    return still_shape("balls", Skeleton(names, parents, places), mesh, SkinWeights(indices, weights)), len(
        points
    )


def solid_angles(point, corners):
    """Returns the winding number of a closed surface about a point, after van Oosterom and Strackee 1983,
    summed over faces.
    """
    x, y, z = (corners - point).transpose(1, 0, 2)
    a, b, c = (np.linalg.norm(side, axis=1) for side in (x, y, z))
    wide = a * b * c + (x * y).sum(1) * c + (y * z).sum(1) * a + (z * x).sum(1) * b
    return 2.0 * np.arctan2(np.linalg.det(corners - point), wide).sum() / (4.0 * np.pi)


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10_000))
def test_what_is_inside_is_what_solid_angles_say(seed):
    random = np.random.default_rng(seed)
    shape, count = balls(random)
    faces = shape.mesh.faces
    shift = random.normal(size=(PARTS, 3)) * 0.6
    moved = shape.mesh.vertices + np.repeat(shift - [[6.0 * k, 0, 0] for k in range(PARTS)], count, 0)
    share, parts = SelfIntersectionTest(shape).measure_overlap(moved)
    corners, beside = moved[faces], {(1, 2), (2, 1), (1, 3), (3, 1), (3, 4), (4, 3)}
    rest = shape.mesh.vertices[faces]
    weight = np.linalg.norm(np.cross(*(rest[:, [1, 2]] - rest[:, :1]).transpose(1, 0, 2)), axis=1) / 2
    part, size = np.repeat(np.arange(PARTS), len(faces) // PARTS), np.ptp(moved, axis=0).max()
    inside, only = np.zeros(len(faces)), {}
    for f in range(len(faces)):
        normal = np.cross(corners[f, 1] - corners[f, 0], corners[f, 2] - corners[f, 0])
        point = corners[f].mean(0) + 1e-4 * size * normal / np.linalg.norm(normal)
        within = [k for k in range(PARTS) if k != part[f] and solid_angles(point, corners[part == k]) > 0.5]
        outside = [k for k in within if (part[f] + 1, k + 1) not in beside]
        # In two parts at once it is told as in one of them, whichever it leaves first.
        inside[f] = np.nan if outside and len(outside) < len(within) else float(bool(outside))
        if len(within) == 1 and outside:
            pair = (int(part[f]) + 1, outside[0] + 1)
            only[pair] = only.get(pair, 0.0) + weight[f] / weight.sum()
    sure = ~np.isnan(inside)
    least, most = (
        weight[inside == 1].sum() / weight.sum(),
        weight[~sure | (inside == 1)].sum() / weight.sum(),
    )
    assert least - 1e-9 <= share <= most + 1e-9
    for pair, lower_bound in only.items():
        assert parts[pair] >= lower_bound - 1e-9


def test_at_rest_nothing_is_inside_nor_what_was_inside_at_rest():
    shape, count = balls(np.random.default_rng(1))
    assert SelfIntersectionTest(shape).measure_overlap(shape.mesh.vertices) == (0.0, {})
    sunk = shape.mesh.vertices - np.repeat([[6.0 * k, 0, 0] for k in range(PARTS)], count, 0)
    stuck = shape.with_changes(mesh=Mesh(sunk, shape.mesh.faces, "stuck"))
    assert SelfIntersectionTest(stuck).measure_overlap(sunk)[0] == 0.0


def test_the_parts_that_are_in_one_another_are_named():
    """The last ball moves into the first one. Their bones share no joint."""
    shape, count = balls(np.random.default_rng(3))
    vertices = shape.mesh.vertices.copy()
    vertices[3 * count :] -= [18.0, 0.0, 0.0]  # moves the last ball to the root, where the first one is
    vertices[:count] += [0.0, 9.0, 0.0]
    assert SelfIntersectionTest(shape).measure_overlap(vertices)[0] == 0.0
    vertices[:count] -= [0.0, 9.0, 0.0]
    share, parts = SelfIntersectionTest(shape).measure_overlap(vertices)
    assert share == pytest.approx(sum(parts.values())) and share > 0.19
    assert set(parts) <= {(1, 4), (4, 1)}
