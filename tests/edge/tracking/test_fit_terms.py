"""The compiled terms of the fit: their gradients are the energies' derivatives, their twins agree."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from enliven_edge.tracking import data_term, model, ranges, terms
from enliven_edge.tracking.capsules import foot, misfits, nearest_capsules
from enliven_edge.tracking.fit import shape
from enliven_edge.tracking.gauss_newton import solve_damped, stepped
from enliven_edge.tracking.kinematics import exponential, logarithm
from enliven_edge.tracking.observation import nearest_columns, nearest_pixel, sampled
from enliven_edge.tracking.posture import Posture, continued, forward

TURNS = (model.DOF_FRAME, model.DOF_AXIS)
PAIRS = shape()[9]
NO_AFFINITY = np.zeros((0, 0), np.float32)


def moved_by(posture: Posture, step) -> Posture:
    return Posture(*stepped(posture.position, posture.rotations, posture.lengths, step, *TURNS))


def random_posture(seed: int, spread: float = 0.3) -> Posture:
    """A person at about 2.5 m in front of the sensor, limbs turned at random."""
    random = np.random.default_rng(seed)
    posture = Posture(np.array([0.1, 0.95, -2.5]), ranges.standing(), model.lengths_for_height(1.7))
    step = np.concatenate([random.normal(0, 0.05, 3), random.normal(0, spread, model.DOFS - 3), np.zeros(12)])
    return moved_by(posture, step)


def surroundings(posture: Posture):
    """(ends, radii, frames, offsets, body) as the terms take them, the capsules without taper.

    The terms take the point of the axis nearest to a sample as fixed, which is exact without taper only.
    """
    ends, radii = posture.capsules()
    radii = np.repeat(radii[:, :1], 2, axis=1)
    world, pivots, by_length = forward(posture.position, posture.rotations, posture.lengths)
    body = (world, pivots, by_length, model.MOVES, *TURNS, model.CAPSULE_UNKNOWNS, model.FRAME_PARENTS)
    return ends, radii, model.CAPSULES.frame, model.CAPSULES.ends, body


def surface_points(posture: Posture, seed: int, count: int = 80, noise: float = 0.01):
    """Points on the posture's capsules, moved by noise, and the outward normals there."""
    random = np.random.default_rng(seed)
    ends, radii = posture.capsules()
    which = random.integers(0, len(ends), count)
    t = random.uniform(0.1, 0.9, count)[:, None]
    axis = ends[which, 1] - ends[which, 0]
    normal = np.cross(axis, random.normal(size=(count, 3)))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    radius = radii[which, :1]
    points = (
        ends[which, 0] * (1 - t)
        + ends[which, 1] * t
        + normal * (radius + random.normal(0, noise, (count, 1)))
    )
    return points.astype(np.float32), normal.astype(np.float32)


def depth_energy(posture: Posture, points, normals):
    matrix, gradient = np.zeros((42, 42)), np.zeros(42)
    energy, _ = data_term.depth_to_model(
        matrix,
        gradient,
        seen_as(points, normals),
        NO_AFFINITY,
        *surroundings(posture),
        1.0,
        0.07,
        0.04,
        np.zeros(len(model.CAPSULES.frame)),
    )
    return energy, gradient


def seen_as(points, normals):
    """(6, M) points and normals as the compiled search takes them."""
    return np.ascontiguousarray(np.concatenate([points.T, normals.T]))


def explainers(posture: Posture, points, normals) -> list[int]:
    """The capsule that explains each point."""
    ends, radii, *_ = surroundings(posture)
    return [nearest(p, n, ends, radii)[0] for p, n in zip(points, normals, strict=True)]


def self_energy(posture: Posture):
    matrix, gradient = np.zeros((42, 42)), np.zeros(42)
    return terms.self_intersection(matrix, gradient, *surroundings(posture), PAIRS, 1.0, 3), gradient


def free_space_energy(posture: Posture, view):
    matrix, gradient = np.zeros((42, 42)), np.zeros(42)
    energy = terms.free_space(
        matrix, gradient, *surroundings(posture), view, 1.0, 0.25, 5, np.zeros(len(model.CAPSULES.frame))
    )
    return energy, gradient


def slope(function, posture: Posture, direction, h: float = 1e-6) -> float:
    """The central difference of an energy along a step of the unknowns."""
    return (
        function(moved_by(posture, h * direction))[0] - function(moved_by(posture, -h * direction))[0]
    ) / (2 * h)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_gradient_of_the_data_term_is_half_the_energy_slope(seed):
    posture = random_posture(seed)
    points, normals = surface_points(random_posture(seed + 1, 0.3), seed)
    direction = np.random.default_rng(seed).normal(size=42)
    direction[model.DOFS :] *= 0.05
    _, gradient = depth_energy(posture, points, normals)
    h = 5e-5  # the search runs in single precision
    ways = [explainers(moved_by(posture, s * h * direction), points, normals) for s in (-1, 1)]
    assume(ways[0] == ways[1])  # the energy jumps where a point changes from one capsule to another
    expected = slope(lambda p: depth_energy(p, points, normals), posture, direction, h)
    assert 2 * gradient @ direction == pytest.approx(expected, rel=0.02, abs=2e-4)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_gradient_of_self_intersection_is_half_the_energy_slope(seed):
    posture = random_posture(seed, 0.9)
    direction = np.random.default_rng(seed).normal(size=42)
    direction[model.DOFS :] *= 0.05
    _, gradient = self_energy(posture)
    girth = model.DOFS + model.GIRTH
    direction[girth] = 0.0  # how far limbs may enter each other does not inflate the person
    assert 2 * gradient @ direction == pytest.approx(
        slope(self_energy, posture, direction), rel=0.02, abs=1e-6
    )


@given(st.integers(0, 10_000), st.floats(0.0, 0.9))
@settings(max_examples=25, deadline=None)
def test_gradient_of_the_floor_is_half_the_energy_slope(seed, sunk):
    posture = random_posture(seed, 0.5)
    posture.position[1] -= sunk
    direction = np.random.default_rng(seed).normal(size=42)
    direction[model.DOFS :] *= 0.05
    _, gradient = floor_energy(posture)
    assert 2 * gradient @ direction == pytest.approx(
        slope(floor_energy, posture, direction), rel=0.02, abs=1e-6
    )


def floor_energy(posture: Posture):
    matrix, gradient = np.zeros((42, 42)), np.zeros(42)
    return terms.above_floor(matrix, gradient, *surroundings(posture), 1.0, 0.02), gradient


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_the_build_is_held_as_its_energy_says(seed):
    """Gradient and matrix against differences; another size costs a tenth of odd proportions."""
    random = np.random.default_rng(seed)
    reference = model.lengths_for_height(1.7)
    lengths = reference * random.uniform(0.8, 1.2, 12)

    def held(at):
        matrix, gradient = np.zeros((42, 42)), np.zeros(42)
        energy = terms.hold_build(matrix, gradient, at, reference, np.full(12, 7.0), 0.1)
        return energy, gradient[30:], np.triu(matrix[30:, 30:]) + np.triu(matrix[30:, 30:], 1).T

    _, gradient, matrix = held(lengths)
    h = 1e-6
    for p in range(12):
        step = h * np.eye(12)[p]
        difference = (held(lengths + step)[0] - held(lengths - step)[0]) / (2 * h)
        assert 2 * gradient[p] == pytest.approx(difference, rel=1e-4, abs=1e-4)
        curvature = (held(lengths + step)[1] - held(lengths - step)[1]) / (2 * h)
        np.testing.assert_allclose(matrix[p], curvature, rtol=1e-4, atol=1e-4)
    odd, larger = reference.copy(), reference * 1.2
    odd[:11:2] *= 1.2
    odd[1:11:2] *= 0.8
    larger[11] = odd[11] = reference[11]
    assert held(larger)[0] < 0.15 * held(odd)[0]
    assert held(reference)[0] == 0.0


def test_the_floor_costs_nothing_to_who_stands_on_it():
    standing = Posture(np.array([0.0, 1.0, -2.0]), ranges.standing(), model.lengths_for_height(1.7))
    ends, radii = standing.capsules()
    standing.position[1] -= (ends[..., 1] - radii).min()
    assert floor_energy(standing)[0] == 0.0
    standing.position[1] -= 0.1
    assert floor_energy(standing)[0] > 0.0


def test_nothing_pulls_on_a_person_who_is_where_the_points_are():
    posture = random_posture(3)
    points, normals = surface_points(posture, 3, noise=0.0)
    energy, gradient = depth_energy(posture, points, normals)
    assert energy < 1e-5
    assert np.abs(gradient).max() < 1e-2


def test_a_limb_in_free_space_is_pushed_into_the_silhouette():
    """A view whose person is a band in the middle and whose wall is far: outside limbs move inward."""
    h, w = 120, 160
    depth, mask = np.full((h, w), 5.0), np.zeros((h, w), bool)
    depth[:, 70:90], mask[:, 70:90] = 2.4, True
    mount = np.diag([1.0, -1.0, -1.0, 1.0])
    mount[1, 3] = 1.0
    view = (depth, mask, nearest_columns(mask), np.array([130.0, 130.0, 79.5, 59.5]), mount)
    posture = Posture(
        np.array([0.0, 0.95, -2.5]), ranges.standing(arm_raise=1.4), model.lengths_for_height(1.7)
    )
    energy, gradient = free_space_energy(posture, view)
    assert energy > 0
    lowered = moved_by(posture, -1e-3 * gradient / np.abs(gradient).max())
    assert free_space_energy(lowered, view)[0] < energy


@given(st.integers(0, 10_000))
@settings(max_examples=50, deadline=None)
def test_logarithm_inverts_exponential(seed):
    v = np.random.default_rng(seed).normal(size=3)
    v *= min(1.0, 3.1 / np.linalg.norm(v))
    np.testing.assert_allclose(logarithm(exponential(v)), v, atol=1e-6)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0.8, 0), (-0.48, 0.6, 0.64)])
def test_logarithm_of_half_a_turn(axis):
    half_turn = exponential(np.pi * np.array(axis, float))
    np.testing.assert_allclose(exponential(logarithm(half_turn)), half_turn, atol=1e-6)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_nearest_capsule_matches_the_obvious_search(seed):
    posture = random_posture(seed)
    ends, radii = posture.capsules()
    point = np.random.default_rng(seed).normal([0, 1, -2.5], 0.5)
    normal = np.array([0.0, 0.0, 1.0])
    costs = []
    for (a, b), (ra, rb) in zip(ends, radii, strict=True):
        t = np.clip((point - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        out = point - (a + t * (b - a))
        distance = np.linalg.norm(out) - (ra + t * (rb - ra))
        costs.append(abs(distance) + 0.04 * (1 - out @ normal / np.linalg.norm(out)))
    likes = np.random.default_rng(seed + 1).uniform(0, 0.1, len(costs)).astype(np.float32)
    # Where two capsules share an end they cost the same; the search compares 18 bits of them.
    costs = np.array(costs)
    for each, liked in ((costs, ()), (costs + likes, (likes,))):
        assert each[nearest(point, normal, ends, radii, *liked)[0]] < each.min() * (1 + 1e-5) + 1e-6


def nearest(point, normal, ends, radii, likes=np.zeros(0, np.float32)):
    """(capsule, t, signed distance) by the compiled search."""
    seen, which = np.concatenate([point, normal]).astype(np.float32)[:, None], np.empty(1, np.int32)
    nearest_capsules(which, seen, likes[:, None], ends, radii, np.float32(0.04))
    c = int(which[0])
    return c, *foot(*point, ends[c], radii[c])


@given(st.integers(0, 10_000))
@settings(max_examples=10, deadline=None)
def test_misfits_are_mean_distances_both_ways(seed):
    postures = [random_posture(seed + k, 0.8) for k in range(2)]
    points = np.random.default_rng(seed).normal([0, 1, -2.5], 0.5, (30, 3)).astype(np.float32)
    shapes = [posture.capsules() for posture in postures]
    made = misfits(np.ascontiguousarray(points.T), np.stack([e for e, _ in shapes]), shapes[0][1], 0.4)
    for (ends, _), value in zip(shapes, made, strict=True):
        radii = shapes[0][1]
        away = np.array([[abs(foot(*p, e, r)[1]) for e, r in zip(ends, radii, strict=True)] for p in points])
        assert value == pytest.approx(np.minimum(away.min(1), 0.4).mean() + away.min(0).mean(), rel=1e-3)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_forward_kinematics_keeps_bone_lengths(seed):
    from enliven.body import BONES

    resting = Posture(np.zeros(3), ranges.standing(), model.lengths_for_height(1.7)).joints()
    joints = random_posture(seed, 0.8).joints()
    for a, b in BONES:
        if (a, b) not in ((0, 1), (14, 15), (18, 19)):  # these cross a frame's pivot
            assert np.linalg.norm(joints[a] - joints[b]) == pytest.approx(
                np.linalg.norm(resting[a] - resting[b])
            )


def test_mirroring_twice_changes_nothing():
    rotations = random_posture(5).rotations
    np.testing.assert_allclose(ranges.mirrored(ranges.mirrored(rotations)), rotations, atol=1e-12)


def test_standing_height_is_the_height_asked_for():
    for height in (1.2, 1.75, 2.0):
        assert model.height_of(model.lengths_for_height(height)) == pytest.approx(height, rel=0.01)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_bones_lie_where_their_orientations_say(seed):
    """Limbs along -Y of their bone's frame, the spine and the neck along +Y, the shoulders across."""
    from enliven.body import Joint
    from enliven.rotation import rotate

    posture = random_posture(seed, 0.8)
    joints, turned = posture.joints(), posture.orientations()
    down, up = np.array([0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0])
    for first in (Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT):
        for k in (1, 2, 3):
            bone = joints[first + k] - joints[first + k - 1]
            np.testing.assert_allclose(
                bone / np.linalg.norm(bone), rotate(turned[first + k], down), atol=1e-9
            )
    for knee in (Joint.KNEE_LEFT, Joint.KNEE_RIGHT):
        for k in (0, 1):
            bone = joints[knee + k] - joints[knee + k - 1]
            np.testing.assert_allclose(bone / np.linalg.norm(bone), rotate(turned[knee + k], down), atol=1e-9)
    for joint in (Joint.SHOULDER_CENTER, Joint.HEAD):
        bone = joints[joint] - joints[joint - 1]
        assert bone @ rotate(turned[joint], up) > 0.98 * np.linalg.norm(bone)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0)


def test_who_stands_upright_has_no_turned_bones():
    turned = Posture(
        np.zeros(3), np.tile(np.eye(3), (13, 1, 1)), model.lengths_for_height(1.7)
    ).orientations()
    np.testing.assert_allclose(np.abs(turned[:, 0]), 1.0)


def test_left_is_left():
    joints = Posture(np.zeros(3), ranges.standing(), model.lengths_for_height(1.7)).joints()
    from enliven.body import Joint

    assert joints[Joint.HAND_LEFT, 0] > 0 > joints[Joint.HAND_RIGHT, 0]
    assert joints[Joint.FOOT_LEFT, 2] > joints[Joint.ANKLE_LEFT, 2]


@given(st.integers(0, 10_000), st.sampled_from([30, 42]))
@settings(max_examples=25, deadline=None)
def test_normal_equations_match_one_row_a_point(seed, count):
    """The fast accumulation by capsule against the obvious one by point, with the real, tapered capsules."""
    posture = random_posture(seed)
    points, normals = surface_points(random_posture(seed + 1), seed)
    ends, radii = posture.capsules()
    *_, body = surroundings(posture)
    frames, local = model.CAPSULES.frame, model.CAPSULES.ends
    fast, fast_gradient = np.zeros((count, count)), np.zeros(count)
    support = np.zeros(len(frames))
    arguments = (
        seen_as(points, normals),
        NO_AFFINITY,
        ends,
        radii,
        frames,
        local,
        body,
        1.0,
        0.07,
        0.04,
        support,
    )
    energy, explained = data_term.depth_to_model(fast, fast_gradient, *arguments)
    slow, slow_gradient, slow_energy = np.zeros((42, 42)), np.zeros(42), 0.0
    for point, normal in zip(points, normals, strict=True):
        c, t, distance = nearest(point, normal, ends, radii)
        cost, weight = terms.robust(distance, 0.07)
        slow_energy += cost / len(points)
        if weight <= 1e-4:
            continue
        foot = ends[c, 0] + t * (ends[c, 1] - ends[c, 0])
        outward = (point - foot) / np.linalg.norm(point - foot)
        row = np.zeros(42)
        terms.point_row(row, -1.0, frames[c], foot, outward, (1 - t) * local[c, 0] + t * local[c, 1], body)
        row[-1] -= (radii[c, 0] + t * (radii[c, 1] - radii[c, 0])) / posture.lengths[-1]
        slow += weight / len(points) * np.outer(row, row)
        slow_gradient += weight / len(points) * distance * row
    # The search runs in single precision.
    assert energy == pytest.approx(slow_energy, rel=1e-4)
    assert 0 <= explained <= 1
    np.testing.assert_allclose(fast_gradient, slow_gradient[:count], atol=1e-6)
    np.testing.assert_allclose(np.triu(fast), np.triu(slow)[:count, :count], atol=1e-5)


@given(st.integers(0, 10_000), st.floats(1e-6, 10.0), st.sampled_from([30, 42]))
@settings(max_examples=25, deadline=None)
def test_the_damped_step_solves_the_damped_system(seed, damping, count):
    rows = np.random.default_rng(seed).normal(size=(2 * count, count))
    gradient = rows[0].copy()
    matrix = rows.T @ rows
    step = np.empty(count)
    solve_damped(step, np.empty((count, count)), np.triu(matrix), gradient, damping)
    damped = matrix + np.diag(damping * np.diag(matrix) + 1e-3)
    np.testing.assert_allclose(damped @ step, -gradient, atol=1e-8)


@given(st.integers(0, 10_000), st.floats(0.001, 0.3))
@settings(max_examples=25, deadline=None)
def test_the_nearest_pixel_is_that_of_the_obvious_search(seed, share):
    random = np.random.default_rng(seed)
    mask = random.uniform(size=(23, 31)) < share
    columns, (v, u) = nearest_columns(mask), random.integers(0, (23, 31))
    row, column = nearest_pixel(v, u, columns)
    if not mask.any():
        assert (row, column) == (-1, -1)
    else:
        rows, places = np.nonzero(mask)
        assert mask[row, column]
        assert (row - v) ** 2 + (column - u) ** 2 == ((rows - v) ** 2 + (places - u) ** 2).min()


@given(st.integers(0, 10_000), st.integers(1, 900))
@settings(max_examples=25, deadline=None)
def test_samples_are_different_pixels_of_the_person_evenly_spread(seed, points):
    mask = np.random.default_rng(seed).uniform(size=(20, 30)) < 0.5
    rows, columns = np.nonzero(mask)
    kept = sampled(mask, points)
    assert len(kept) == min(points, len(rows))
    index = {pair: k for k, pair in enumerate(zip(rows, columns, strict=True))}
    order = np.array([index[tuple(pair)] for pair in kept])
    assert (np.diff(order) > 0).all()
    assert np.ptp(np.diff(order)) <= 1 if len(order) > 2 else True


def test_a_posture_goes_on_as_it_turned():
    """A share of the last turn again, and never faster than a person turns."""
    before, now = random_posture(1, 0.1), random_posture(1, 0.1)
    slow, fast = np.array([0.1, -0.05, 0.02]), np.array([0.0, 2.0, 0.0])
    now.rotations[model.HEAD] = before.rotations[model.HEAD] @ exponential(slow)
    now.rotations[model.CHEST] = before.rotations[model.CHEST] @ exponential(fast)
    made = continued(before, now)
    for frame, turn in ((model.HEAD, 0.8 * slow), (model.CHEST, np.array([0.0, 0.25, 0.0]))):
        expected = now.rotations[frame] @ exponential(turn)
        np.testing.assert_allclose(made.rotations[frame], expected, atol=1e-9)
