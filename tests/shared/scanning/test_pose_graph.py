"""Tests of a pose graph: its invariants, and a slow reference."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from enliven import rotation
from enliven.scanning.loop_closure.pose_graph import (
    PoseLink,
    link_jacobians,
    link_residual,
    optimize_poses,
    pose_graph_cost,
)
from enliven.scanning.rigid import invert_pose, move_pose, pose_difference

SEEDS = st.integers(0, 10_000)
LEVEL = 0.01


def made(seed, count=6, noise=0.0, loops=2):
    """Returns true poses around a circle, and links between them with errors of ``noise`` standard
    deviations.
    """
    random = np.random.default_rng(seed)
    poses = []
    for _ in range(count):
        step = np.concatenate([random.normal(0, 0.5, 3), random.normal(0, 0.4, 3)])
        poses.append(move_pose(poses[-1], step) if poses else np.eye(4))
    pairs = [(n, n + 1, True) for n in range(count - 1)]
    pairs += [(n, count - 1 - n, False) for n in range(loops)]
    links = []
    for first, second, sure in pairs:
        root = random.normal(0, 1, (6, 6)) / 10 + np.diag([1 / 0.02] * 3 + [1 / 0.01] * 3)
        off = noise * np.linalg.solve(root, random.normal(0, 1, 6))
        seen = invert_pose(poses[first]) @ poses[second]
        links.append(PoseLink(first, second, move_pose(seen, off), root.T @ root, sure))
    return poses, links, random


def shaken(poses, random, size):
    """Returns the poses, each except the first moved and rotated randomly by ``size``."""
    return [poses[0], *(move_pose(pose, random.normal(0, size, 6)) for pose in poses[1:])]


@settings(max_examples=20)
@given(seed=SEEDS)
@pytest.mark.slow
def test_links_without_error_bring_all_poses_back(seed):
    poses, links, random = made(seed)
    poses_found, belief = optimize_poses(shaken(poses, random, 0.1), links)
    assert max(max(pose_difference(a, b)) for a, b in zip(poses_found, poses, strict=True)) < 1e-6
    np.testing.assert_allclose(belief, 1.0, atol=1e-6)


@settings(max_examples=8)
@given(seed=SEEDS)
def test_the_sparse_solution_is_the_slow_one(seed):
    """The twin turns every residual into a number of scipy's least squares, with slopes by differences."""
    poses, links, random = made(seed, count=4, noise=12.0, loops=1)
    links = [PoseLink(k.first, k.second, k.first_from_second, k.information) for k in links]
    ups = [rotation.unit(pose[:3, :3].T @ [0.0, 1.0, 0.0] + random.normal(0, LEVEL, 3)) for pose in poses]
    start = shaken(poses, random, 0.05)
    poses_found, belief = optimize_poses(start, links, ups, LEVEL)
    aim = start[0][:3, :3] @ ups[0]
    roots = [np.linalg.cholesky(link.information).T for link in links]

    def placed(x):
        return [start[0], *(move_pose(pose, x[6 * n : 6 * n + 6]) for n, pose in enumerate(start[1:]))]

    def errors(x):
        now = placed(x)
        of_links = [
            root @ link_residual(link, now[link.first], now[link.second])
            for root, link in zip(roots, links, strict=True)
        ]
        of_ups = [(pose[:3, :3] @ up - aim) / LEVEL for pose, up in zip(now, ups, strict=True)]
        return np.concatenate(of_links + of_ups)

    slow = placed(least_squares(errors, np.zeros(6 * len(start) - 6), xtol=1e-12, ftol=1e-12).x)
    # Both stop where no step gains; least squares are flat there to the root of the rounding.
    assert max(max(pose_difference(a, b)) for a, b in zip(poses_found, slow, strict=True)) < 2e-4
    assert pose_graph_cost(poses_found, links, belief, ups, LEVEL) <= pose_graph_cost(
        slow, links, belief, ups, LEVEL
    ) * (1 + 1e-5)


@pytest.mark.slow
@settings(max_examples=10)
@given(seed=SEEDS)
def test_a_loop_that_is_wrong_is_found_out(seed):
    poses, links, random = made(seed, count=8, noise=0.3, loops=3)
    wrong = move_pose(
        invert_pose(poses[1]) @ poses[6], np.concatenate([random.choice([-1, 1], 3), np.zeros(3)])
    )
    poses_found, belief = optimize_poses(
        poses, [*links, PoseLink(1, 6, wrong, links[0].information, sure=False)]
    )
    assert belief[-1] < 0.05 and belief[:-1].min() > 0.5
    assert max(pose_difference(a, b)[0] for a, b in zip(poses_found, poses, strict=True)) < 0.1


@pytest.mark.slow
@settings(max_examples=10)
@given(seed=SEEDS)
def test_the_world_may_lie_anywhere(seed):
    poses, links, random = made(seed, noise=1.0)
    world = move_pose(np.eye(4), random.normal(0, 2, 6))
    there, _ = optimize_poses([world @ pose for pose in poses], links)
    here, _ = optimize_poses(poses, links)
    assert max(max(pose_difference(world @ a, b)) for a, b in zip(here, there, strict=True)) < 1e-5


def test_measured_gravity_keeps_a_chain_level():
    """Each link is slightly tilted, so the chain would bend. The measured up direction prevents this."""
    tilt = move_pose(np.eye(4), np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.02]))
    links = [PoseLink(n, n + 1, tilt, np.diag([1e4] * 6)) for n in range(10)]
    poses = [move_pose(np.eye(4), np.array([0.5 * n, 0, 0, 0, 0, 0])) for n in range(11)]
    up = np.array([0.0, 1.0, 0.0])
    bent, _ = optimize_poses(poses, links)
    level, _ = optimize_poses(poses, links, [up] * 11, level=0.001)
    assert np.arccos(bent[-1][1, 1]) > 0.15 and np.arccos(level[-1][1, 1]) < 0.005


@settings(max_examples=25)
@given(seed=SEEDS)
def test_the_slopes_are_those_of_small_differences(seed):
    """Large residuals: there the inverse left Jacobian differs from 1, and its sign from the other one."""
    random = np.random.default_rng(seed)
    first, second = (move_pose(np.eye(4), random.normal(0, 1.0, 6)) for _ in range(2))
    off = np.concatenate(
        [random.normal(0, 0.5, 3), random.uniform(0.3, 1.5) * rotation.unit(random.normal(size=3))]
    )
    link = PoseLink(0, 1, move_pose(invert_pose(first) @ second, off), np.eye(6))
    error, of_first, of_second = link_jacobians(link, first, second)
    np.testing.assert_allclose(error, link_residual(link, first, second))
    step = 1e-6
    for slopes, at in ((of_first, 0), (of_second, 1)):
        differences = np.empty((6, 6))
        for k in range(6):
            ends = []
            for way in (step, -step):
                poses = [first, second]
                poses[at] = move_pose(poses[at], way * np.eye(6)[k])
                ends.append(link_residual(link, *poses))
            differences[:, k] = (ends[0] - ends[1]) / (2 * step)
        # Central differences are off by the square of the step, and by the rounding over the step.
        np.testing.assert_allclose(slopes, differences, atol=1e-6)
