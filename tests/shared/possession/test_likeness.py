"""Where a person's joints would be in other meshes: laws, and meshes made for it."""

from __future__ import annotations

import numpy as np
import pytest
from sample_meshes.isosurface import surface_of

from enliven.deformation.graph.graph import DeformationGraph
from enliven.meshes.mesh import Mesh
from enliven.person.joints import Joint
from enliven.possession.body_in_mesh import extremities, find_body_in_mesh


def capsules(points, ends, radii):
    """(N,) metres from points to capsules, negative inside."""
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
    return DeformationGraph.build(mesh, nodes=nodes, seed=seed)


@pytest.mark.parametrize("turn", [-2.5, -1.0, 0.4, 1.5, 3.0])
def test_a_person_is_like_a_person_whichever_way_they_face(turn):
    like = find_body_in_mesh(built(BIPED, GIRTH, turn))
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
    graph = built(BIPED, GIRTH)
    tips, lengths, ways = extremities(graph)
    at = graph.positions[tips]
    assert len(tips) == 5 and (lengths > 0.15).all() and ways.shape == (5, 96)
    for where in ((0, 1.7, 0), (0.5, 0.95, 0), (-0.5, 0.95, 0), (0.16, 0, 0.2), (-0.16, 0, 0.2)):
        assert np.linalg.norm(at - where, axis=1).min() < 0.2


def test_a_pole_is_spine_and_arm_and_has_no_legs():
    graph = built([((0, 0.1, 0), (0, 1.4, 0)), ((0, 1.4, 0), (0, 1.5, 0.5))], [0.08, 0.08])
    like = find_body_in_mesh(graph)
    assert np.isnan(like.joints[Joint.KNEE_LEFT]).all() and np.isnan(like.leg)
    assert np.isfinite(like.joints[[Joint.HIP_CENTER, Joint.HEAD, Joint.HAND_RIGHT]]).all()
    assert like.joints[Joint.HIP_CENTER, 1] < 0.4 and like.joints[Joint.HAND_RIGHT, 1] > 1.1


@pytest.mark.parametrize("nodes", [1, 2, 3, 8])
def test_few_nodes_and_a_ball_do_no_harm(nodes):
    graph = built([((0, 0.5, 0), (0, 0.5, 0.01))], [0.15], nodes=nodes)
    like = find_body_in_mesh(graph)
    assert np.isfinite(like.joints[Joint.HIP_CENTER]).all() and np.isfinite(like.yaw)
