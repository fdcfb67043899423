"""Tests of sketches: any closed stroke becomes a closed, even, weighted part with correctly placed bones."""

import numpy as np
import pytest
import strokes
from hypothesis import given, settings
from hypothesis import strategies as st
from mesh_makers import partition_of_unity, volume, watertight

from enliven.errors import InputError
from enliven.modeling.mesh.cut_loops import winding_number
from enliven.modeling.sketching.axis_bones import simplify_chain
from enliven.modeling.sketching.outline import find_crossing_segments, trace_outline
from enliven.modeling.sketching.sketch import SketchPlane, shape_from_stroke

ALL = {
    "tentacle": strokes.tentacle(),
    "mantis": strokes.mantis_leg(),
    "torso": strokes.torso(),
    "star": strokes.star(),
    "hand": strokes.hand(),
}


def shapes():
    return {name: shape_from_stroke(stroke, id=name) for name, stroke in ALL.items()}


@pytest.mark.parametrize("name", ALL)
def test_a_part_is_closed_even_and_weighted(name):
    shape = shape_from_stroke(ALL[name], id=name)
    mesh = shape.mesh
    assert watertight(mesh) and volume(mesh) > 0 and partition_of_unity(shape.skin)
    edges = np.unique(np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), 1), axis=0)
    assert len(mesh.vertices) - len(edges) + len(mesh.faces) == 2  # a sphere
    sides = np.linalg.norm(mesh.vertices[mesh.faces] - mesh.vertices[np.roll(mesh.faces, -1, 1)], axis=2)
    quality = 2 * np.sqrt(3) * np.linalg.norm(mesh.face_vectors(), axis=1) / (sides**2).sum(1)
    assert quality.mean() > 0.8 and quality.min() > 0.15
    # Both halves are symmetric, and the outline is that of the stroke.
    low, high = mesh.bounds
    assert low[2] == pytest.approx(-high[2], rel=0.05)
    outline = trace_outline(ALL[name], 200)
    size = float(np.ptp(outline, axis=0).max())
    np.testing.assert_allclose([low[:2], high[:2]], [outline.min(0), outline.max(0)], atol=0.02 * size)
    # Every joint is inside the outline, and every vertex follows a near bone.
    for joint in shape.skeleton.positions:
        assert abs(winding_number(outline, joint[:2])) > 0.5 and joint[2] == 0


def test_bones_run_where_the_limbs_are():
    sketched = shapes()
    mantis, star, tentacle = (
        sketched["mantis"].skeleton,
        sketched["star"].skeleton,
        sketched["tentacle"].skeleton,
    )
    # The only joints are the corners of the mantis's leg.
    corners = np.array([[0, 0], [-0.16, -0.42], [0.5, -0.02], [0.24, -0.52], [0.36, -0.66]])
    far = np.linalg.norm(mantis.positions[:, None, :2] - corners[None], axis=2)
    assert len(mantis) == 5 and far.min(0).max() < 0.06
    assert all(len(below) <= 1 for below in mantis.children)
    assert len(star.children[0]) == 5 and len(star) == 6
    np.testing.assert_allclose(star.positions[0], 0, atol=0.05)
    # The root of the tentacle is at its thick end.
    assert tentacle.positions[0, 1] < 0.2 and tentacle.positions[:, 1].max() > 1.3
    assert len(sketched["hand"].skeleton.children) - sum(map(bool, sketched["hand"].skeleton.children)) == 5


DOG = np.array(
    [[-0.6, 0.1], [-0.55, -0.5], [-0.42, -0.5], [-0.4, -0.1], [0.2, -0.1], [0.22, -0.5], [0.36, -0.5],
     [0.4, 0.05], [0.5, 0.35], [0.75, 0.3], [0.78, 0.45], [0.55, 0.6], [0.5, 0.75], [0.42, 0.6],
     [0.3, 0.3], [-0.45, 0.25], [-0.75, 0.5], [-0.8, 0.45]]
)  # fmt: skip


def test_a_dog_has_legs_a_tail_and_a_head():
    skeleton = shape_from_stroke(DOG).skeleton
    ends = [j for j, below in enumerate(skeleton.children) if not below or (j == 0 and len(below) == 1)]
    tips = np.array([[-0.49, -0.5], [0.29, -0.5], [-0.77, 0.47], [0.76, 0.37], [0.5, 0.74]])
    far = np.linalg.norm(skeleton.positions[ends][:, None, :2] - tips[None], axis=2)
    assert len(ends) == 5 and far.min(0).max() < 0.12


@pytest.mark.parametrize("turns", [0.8, 1.8])
def test_a_curl_is_followed_by_its_bones(turns):
    t = np.linspace(0.25, 1, 90)
    path = np.stack([t * np.cos(2 * np.pi * turns * t), t * np.sin(2 * np.pi * turns * t)], 1)
    skeleton = shape_from_stroke(strokes.ribbon(path, np.full(90, 0.06))).skeleton
    assert len(skeleton) >= 6 and all(len(below) <= 2 for below in skeleton.children)
    far = np.linalg.norm(skeleton.positions[:, None, :2] - path[None], axis=2).min(1)
    assert far.max() < 0.05


def test_a_square_stands_upright():
    square = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    shape = shape_from_stroke(square)
    assert len(shape.skeleton) == 2 and watertight(shape.mesh)
    vector = np.abs(shape.skeleton.vectors[1])
    assert vector[1] > 0.5 and vector[0] < 0.05


def test_a_disc_becomes_a_ball_and_a_strip_a_round_rod():
    turn = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    disc = shape_from_stroke(np.stack([np.cos(turn), np.sin(turn)], 1))
    assert volume(disc.mesh) == pytest.approx(4 / 3 * np.pi, rel=0.06)
    rod = shape_from_stroke(strokes.limb(np.array([[0.0, 0], [4.0, 0]]), np.array([0.2, 0.2])))
    middle = np.abs(rod.mesh.vertices[:, 0] - 2) < 1
    away = np.linalg.norm(rod.mesh.vertices[middle, 1:], axis=1)
    np.testing.assert_allclose(away, 0.2, rtol=0.06)
    flat = shape_from_stroke(np.stack([np.cos(turn), np.sin(turn)], 1), depth=0.5)
    assert volume(flat.mesh) == pytest.approx(volume(disc.mesh) / 2, rel=0.02)
    # This also holds if a limb is so thin that no sample point is inside it.
    thin = strokes.limb(np.array([[0.0, 0], [4.0, 0]]), np.array([0.02, 0.02]))
    low, high = shape_from_stroke(thin, depth=0.5).mesh.bounds
    assert high[2] - low[2] == pytest.approx(0.02, rel=0.2)


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(
    radii=st.lists(st.floats(0.35, 1.0), min_size=5, max_size=24),
    backwards=st.booleans(),
    scale=st.floats(1e-3, 1e3),
)
def test_any_stroke_that_does_not_cross_itself_becomes_a_part(radii, backwards, scale):
    turn = 2 * np.pi * np.arange(len(radii)) / len(radii)
    stroke = scale * np.stack([np.cos(turn), np.sin(turn)], 1) * np.array(radii)[:, None]
    shape = shape_from_stroke(stroke[::-1] if backwards else stroke)
    assert watertight(shape.mesh) and volume(shape.mesh) > 0 and partition_of_unity(shape.skin)
    assert len(shape.skeleton) >= 2


def test_a_plane_puts_the_part_where_it_was_drawn():
    plane = SketchPlane(np.array([1.0, 2, 3]), np.array([0, 0, -2.0]), np.array([0, 3.0, 1.0]))
    here, there = shape_from_stroke(ALL["star"]), shape_from_stroke(ALL["star"], plane)
    axes = np.array([[0, 0, -1.0], [0, 1, 0], [1, 0, 0]])
    np.testing.assert_allclose(there.mesh.vertices, plane.origin + here.mesh.vertices @ axes, atol=1e-12)
    np.testing.assert_allclose(there.skeleton.positions, plane.origin + here.skeleton.positions @ axes)
    with pytest.raises(InputError, match="are parallel or 0"):
        shape_from_stroke(ALL["star"], SketchPlane(np.zeros(3), np.ones(3), np.ones(3)))


def test_the_ends_of_a_stroke_may_run_past_each_other():
    turn = np.linspace(0, 2 * np.pi, 200)
    stroke = np.stack([np.cos(turn), np.sin(turn)], 1)
    past = np.concatenate([[[0.9, -0.2], [1.02, -0.1]], stroke[1:], [[0.98, 0.05], [1.08, 0.12]]])
    outline = trace_outline(past, 100)
    assert np.linalg.norm(outline, axis=1).max() < 1.1
    assert np.abs(np.linalg.norm(outline, axis=1) - 1).max() < 0.12


@pytest.mark.parametrize(
    ("stroke", "why"),
    [
        ([[0, 0], [1, 1], [1, 0], [0, 1]], "crosses itself"),
        ([[0, 0], [1, 0]], "dot or a line"),
        ([[0, 0], [0, 0], [0, 0]], "dot or a line"),
        ([[0, 0], [1, 0], [2, 0], [1, 1e-9]], "encloses no area"),
        ([[0, 0], [1, np.nan], [1, 1]], "not finite numbers"),
        (np.zeros((0, 2)), "dot or a line"),
    ],
)
def test_invalid_outline_is_refused_with_a_reason(stroke, why):
    with pytest.raises(InputError, match=why):
        shape_from_stroke(np.array(stroke, float))


def test_simplification_keeps_corners_and_evens_out_the_rest():
    along = np.linspace(0, 1, 41)
    straight = np.stack([along, 0 * along], 1)
    assert simplify_chain(straight, np.full(41, 0.1), 0.4, 100) == [0, 40]
    assert simplify_chain(straight, np.full(41, 0.05), 0.4, 2.5) == [0, 10, 20, 30, 40]
    bent = np.where(along[:, None] < 0.5, [[1.0, 0]] * along[:, None], 0)
    bent = np.stack([np.minimum(along, 0.5), np.maximum(along - 0.5, 0)], 1)
    assert simplify_chain(bent, np.full(41, 0.1), 0.4, 100) == [0, 20, 40]
    cone = 0.02 + 0.3 * along
    assert len(simplify_chain(straight, cone, 0.3, 100)) > 2


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(3, 25), closed=st.booleans())
def test_crossings_are_those_that_solving_finds(seed, count, closed):
    points = np.random.default_rng(seed).random((count, 2))
    starts, ends = (points, np.roll(points, -1, 0)) if closed else (points[:-1], points[1:])
    slow = []
    for i in range(len(starts)):
        for j in range(i + 2, len(starts)):
            if closed and i == 0 and j == len(starts) - 1:
                continue
            s, t = np.linalg.solve(
                np.stack([ends[i] - starts[i], starts[j] - ends[j]], 1), starts[j] - starts[i]
            )
            if 0 <= s <= 1 and 0 <= t <= 1:
                slow.append([i + s, j + t])
    np.testing.assert_allclose(
        find_crossing_segments(points, closed), np.array(slow).reshape(-1, 2), atol=1e-6
    )
