"""Tests of finding where a person's joints would be in other meshes: invariants, and meshes made for this."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.isosurface import surface_of

from enliven.deformation.graph.graph import DeformationGraph
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh
from enliven.person.joints import Joint
from enliven.possession.likeness.any_mesh import find_extremities
from enliven.possession.likeness.finding import find_body_in_mesh
from enliven.possession.likeness.tree_of_limbs import tree_misfit


def capsules(points, ends, radii):
    """Returns (N,) signed distances in metres from points to capsules, negative inside."""
    best = np.full(len(points), np.inf)
    for (a, b), radius in zip(np.asarray(ends, float), radii, strict=True):
        share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * (b - a), axis=1) - radius)
    return best


BIPED = [
    ((0, 0.9, 0), (0, 1.4, 0)), ((0, 1.4, 0), (0, 1.65, 0)),
    ((0, 1.4, 0), (0.5, 0.95, 0)), ((0, 1.4, 0), (-0.5, 0.95, 0)),
    ((0.13, 0.9, 0), (0.15, 0.06, 0)), ((-0.13, 0.9, 0), (-0.15, 0.06, 0)),
    ((0.15, 0.06, 0), (0.16, 0.05, 0.2)), ((-0.15, 0.06, 0), (-0.16, 0.05, 0.2)),
]  # fmt: skip
GIRTH = [0.12, 0.1, 0.06, 0.06, 0.07, 0.07, 0.05, 0.05]


def built(ends, radii, turn=0.0, nodes=96, seed=0):
    c, s = np.cos(turn), np.sin(turn)
    ends = np.asarray(ends, float) @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T
    low, high = ends.reshape(-1, 3).min(0) - 0.2, ends.reshape(-1, 3).max(0) + 0.2
    mesh = Mesh(*surface_of(lambda p: capsules(p, ends, radii), low, high, 0.045), "made")
    return mesh, DeformationGraph.build(mesh, nodes=nodes, seed=seed)


@pytest.mark.parametrize("turn", [-2.5, -1.0, 0.4, 1.5, 3.0])
def test_a_person_is_like_a_person_whichever_way_they_face(turn):
    like = find_body_in_mesh(*built(BIPED, GIRTH, turn))
    apart = (like.yaw - turn + np.pi) % (2 * np.pi) - np.pi
    assert abs(apart) < 0.4, "the toes say where the front is"
    c, s = np.cos(turn), np.sin(turn)
    joints = like.joints @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    expected = {
        Joint.HEAD: (0, 1.65, 0),
        Joint.HAND_LEFT: (0.5, 0.95, 0),
        Joint.HAND_RIGHT: (-0.5, 0.95, 0),
        Joint.ANKLE_LEFT: (0.15, 0.1, 0),
        Joint.ANKLE_RIGHT: (-0.15, 0.1, 0),
        Joint.SHOULDER_CENTER: (0, 1.4, 0),
        Joint.HIP_CENTER: (0, 0.9, 0),
    }
    for joint, where in expected.items():
        near = 0.4 if joint in (Joint.HIP_CENTER, Joint.SHOULDER_CENTER) else 0.2
        assert np.linalg.norm(joints[joint] - where) < near, joint.name


def test_limbs_are_found_by_how_far_they_stand_out():
    _, graph = built(BIPED, GIRTH)
    tips, lengths, ways = find_extremities(graph)
    at = graph.positions[tips]
    assert len(tips) == 5 and (lengths > 0.15).all() and ways.shape == (5, 96)
    for where in ((0, 1.7, 0), (0.5, 0.95, 0), (-0.5, 0.95, 0), (0.16, 0, 0.2), (-0.16, 0, 0.2)):
        assert np.linalg.norm(at - where, axis=1).min() < 0.2


def test_a_pole_is_spine_and_arm_and_has_no_legs():
    pole = built([((0, 0.1, 0), (0, 1.4, 0)), ((0, 1.4, 0), (0, 1.5, 0.5))], [0.08, 0.08])
    like = find_body_in_mesh(*pole)
    assert not like.human and np.isnan(like.joints[Joint.KNEE_LEFT]).all() and np.isnan(like.leg_length)
    assert np.isfinite(like.joints[[Joint.HIP_CENTER, Joint.HEAD, Joint.HAND_RIGHT]]).all()
    assert like.joints[Joint.HIP_CENTER, 1] < 0.4 and like.joints[Joint.HAND_RIGHT, 1] > 1.1


@pytest.mark.parametrize("nodes", [1, 2, 3, 8])
def test_few_nodes_and_a_ball_do_no_harm(nodes):
    like = find_body_in_mesh(*built([((0, 0.5, 0), (0, 0.5, 0.01))], [0.15], nodes=nodes))
    assert np.isfinite(like.joints[Joint.HIP_CENTER]).all() and np.isfinite(like.yaw)


def test_ends_that_the_artist_names_are_taken_as_they_are():
    """Hands and feet are exchanged, so the arms are found at the named positions."""
    mesh, graph = built(BIPED, GIRTH)
    like = find_body_in_mesh(mesh, graph)
    head, *others = like.ends
    same = find_body_in_mesh(mesh, graph, like.ends)
    np.testing.assert_allclose(same.joints, like.joints, atol=0.03)
    swapped = find_body_in_mesh(mesh, graph, np.array([head, *others[2:], *others[:2]]))
    hands = swapped.joints[[Joint.HAND_LEFT, Joint.HAND_RIGHT]]
    assert hands[:, 1].max() < 0.2 < like.joints[Joint.HAND_LEFT, 1]
    with pytest.raises(InputError, match="expected 5"):
        find_body_in_mesh(mesh, graph, like.ends[:3])


def test_ambiguity_is_reported():
    """Without feet and with straight limbs, front and back cannot be distinguished."""
    mesh, graph = built([*BIPED[:6], ((0, 1.65, 0), (0, 1.66, 0))], [*GIRTH[:6], 0.1], turn=np.pi / 2)
    assert any("front" in doubt for doubt in find_body_in_mesh(mesh, graph).doubts)
    assert not find_body_in_mesh(*built(BIPED, GIRTH)).doubts


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=200, deadline=None)
def test_ways_of_a_tree_of_limbs_give_its_lengths(seed):
    """The law: ways along any person's tree cost only what its proportions do, and its lengths come back."""
    dice = np.random.default_rng(seed)
    head, arm, trunk, leg = lengths = dice.uniform(0.2, 1.0, 4)
    ends = [("chest", head), ("chest", arm), ("chest", arm), ("pelvis", leg), ("pelvis", leg)]
    distances = [
        a[1] + b[1] + (trunk if a[0] != b[0] else 0.0) for i, a in enumerate(ends) for b in ends[i + 1 :]
    ]
    cost, solved = tree_misfit(np.array([distances]))
    np.testing.assert_allclose(solved[0], lengths, rtol=1e-9)
    usual = [(head / arm / 0.5, 0.5), (leg / arm / 1.15, 0.4), (trunk / arm / 0.55, 0.5)]
    assert cost[0] == pytest.approx(sum((np.log(ratio) / spread) ** 2 for ratio, spread in usual))
    worse, _ = tree_misfit(np.array([distances]) + dice.uniform(0.2, 0.5, 10) * dice.choice([-1, 1], 10))
    assert worse[0] > 0
