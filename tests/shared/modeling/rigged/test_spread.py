"""Tests of copying one limb's motion to all equal limbs: exact, rotated or mirrored, and each later than the
last.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import assert_alike

from enliven.document.clip import Clip
from enliven.document.project import Project
from enliven.document.rigged import still_shape
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.matching.symmetry import find_equal_limbs
from enliven.modeling.rigged.spread import spread_motion
from enliven.motion.layers.evaluate import evaluate_pose
from enliven.motion.layers.retarget import bind_chain
from enliven.rotation import from_rotation_vector, multiply, to_matrix

LIMB = np.array([[0.3, 0.0, 0.0], [0.6, 0.1, 0.2], [0.9, -0.2, 0.5]])


def star(linears):
    """Returns a body with limbs. Each is LIMB transformed by one of the (3, 3) matrices."""
    points, parents = [np.zeros(3)], [-1]
    for linear in linears:
        for i, point in enumerate(LIMB @ linear.T):
            parents.append(0 if i == 0 else len(points) - 1)
            points.append(point)
    return Skeleton(tuple(f"j{i}" for i in range(len(points))), np.array(parents), np.array(points))


def waving(seed):
    """Returns a take of an arm of four joints."""
    rng = np.random.default_rng(seed)
    skeleton = Skeleton(tuple("abcd"), np.array([-1, 0, 1, 2]), np.cumsum(rng.normal(size=(4, 3)), 0))
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (40, 4, 1))
    phases = np.linspace(0.0, 6.0, 40)
    for joint in range(1, 4):
        swing = from_rotation_vector(0.6 * np.sin(phases[:, None] + rng.normal(size=3)) * rng.normal(size=3))
        turns[:, joint] = multiply(turns[:, joint - 1], swing)
    return Clip("wave", skeleton, turns, np.zeros((40, 3)), 1 / 20)


def animated(skeleton, seed, mirrored=False):
    """Returns a project in which the first limb waves."""
    project = Project().with_characters(still_shape("star", skeleton)).with_takes(waving(seed))
    return bind_chain(project, "star", (0, 1, 2, 3), "wave", (0, 1, 2, 3), loop=True, mirrored=mirrored)


TURNS = [to_matrix(from_rotation_vector(np.array([0.0, a, 0.0]))) for a in np.arange(5) * 2 * np.pi / 5]
MIRRORED = [np.eye(3), np.diag([-1.0, 1.0, 1.0])]


@pytest.mark.parametrize("linears", [TURNS, MIRRORED], ids=["turned", "mirrored"])
@pytest.mark.parametrize("mirrored", [False, True], ids=["as performed", "seen in a mirror"])
@given(seed=st.integers(0, 2**32 - 1), delay=st.floats(0.0, 0.5))
@settings(max_examples=10, deadline=None)
def test_the_copies_move_alike_and_later(linears, mirrored, seed, delay):
    skeleton = star(linears)
    (group,) = find_equal_limbs(skeleton)
    before = animated(skeleton, seed, mirrored)
    after = spread_motion(before, "star", group, 2, delay=delay)
    own = group.limb_of(2)
    seconds = 1.3
    now = evaluate_pose(after, "star", seconds).joints
    assert_alike(now[1:4], evaluate_pose(before, "star", seconds).joints[1:4])
    for other in range(len(group.limbs)):
        later = seconds - delay * ((other - own) % len(group.limbs))
        then = evaluate_pose(before, "star", later).joints
        for start, end in group.joint_map(own, other).items():
            np.testing.assert_allclose(now[end], group.get_map(own, other) @ then[start], atol=1e-9)


def test_spreading_again_leaves_no_layer_behind():
    skeleton = star(TURNS)
    (group,) = find_equal_limbs(skeleton)
    once = spread_motion(animated(skeleton, 1), "star", group, 1, delay=0.1)
    again = spread_motion(once, "star", group, 1, delay=0.2)
    assert len(once.layer_names) == len(again.layer_names) == 5
    assert again.takes == once.takes


def test_a_limb_without_motion_or_of_another_group_is_refused():
    skeleton = star(MIRRORED)
    (group,) = find_equal_limbs(skeleton)
    project = animated(skeleton, 1)
    with pytest.raises(InputError, match="no take moves"):
        spread_motion(project, "star", group, 5)
    with pytest.raises(InputError, match=r"belongs to no limb of the group.*begin at"):
        spread_motion(project, "star", group, 0)
