"""Tests that one-shot functions return the results of their solvers, and that refusals name a remedy."""

from dataclasses import replace

import numpy as np
import pytest

from enliven import (
    Body,
    PlaneCut,
    Project,
    Skeleton,
    copy,
    cut,
    export,
    fit_examples,
    load_sample,
    match,
    merge,
    mesh_at,
    possess,
)
from enliven.errors import InputError
from enliven.matching.body_limbs import body_source
from enliven.matching.ranking import Matcher
from enliven.matching.views import ScreenView
from enliven.motion_clips.joint_positions import clip_of_bodies
from enliven.person import J, Joint
from enliven.rotation import from_rotation_vector, rotate

STEP = 0.1


HALF = [
    (Joint.SHOULDER_LEFT, (0.18, 1.40, 0.0)),
    (Joint.ELBOW_LEFT, (0.22, 1.12, 0.0)),
    (Joint.WRIST_LEFT, (0.24, 1.10, 0.25)),
    (Joint.HAND_LEFT, (0.24, 1.10, 0.35)),
    (Joint.HIP_LEFT, (0.10, 0.90, 0.0)),
    (Joint.KNEE_LEFT, (0.20, 0.50, 0.0)),
    (Joint.ANKLE_LEFT, (0.22, 0.10, 0.0)),
    (Joint.FOOT_LEFT, (0.22, 0.02, 0.10)),
]
"""The left side of a person standing in the chair, metres."""
TRUNK = [(0.0, 0.95, 0.0), (0.0, 1.10, 0.0), (0.0, 1.40, 0.0), (0.0, 1.60, 0.0)]


def standing(bow: float = 0.0) -> Body:
    """Returns a person in the chair that bows by an angle in radians."""
    joints = np.zeros((J, 3))
    joints[:4] = TRUNK
    for joint, place in HALF:
        joints[joint], joints[joint + 4] = place, (-place[0], *place[1:])
    joints[1:12] = rotate(from_rotation_vector(np.array([bow, 0.0, 0.0])), joints[1:12] - TRUNK[0]) + TRUNK[0]
    return Body(1, joints, np.ones(J))


@pytest.fixture(scope="module")
def performed() -> tuple[Project, str]:
    bodies = [standing(0.2 * n) for n in range(6)]
    return possess(load_sample("chair"), bodies, STEP, nodes=64)


def test_possessed_mesh_starts_at_rest_and_moves(performed):
    project, chair = performed
    rest = load_sample("chair").vertices
    assert np.abs(mesh_at(project, chair, 0.0).vertices - rest).max() < 0.02
    assert np.abs(mesh_at(project, chair, 0.5).vertices - rest).max() > 0.05


def test_second_character_gets_a_unique_name(performed):
    project, chair = performed
    both, other = possess(load_sample("chair"), [standing(), standing(0.1)], STEP, nodes=64, project=project)
    assert other != chair
    assert (mesh_at(both, chair, 0.5).vertices == mesh_at(project, chair, 0.5).vertices).all()


def test_cut_keeps_world_pose(performed):
    project, chair = performed
    whole = mesh_at(project, chair, 0.3).vertices
    parts, names = cut(project, chair, PlaneCut(np.array([0, 1.0, 0]), np.array([0, 1.0, 0])), 0.3)
    seen = np.concatenate([mesh_at(parts, name, 0.3).vertices for name in names])
    lost = [place for place in whole[::97] if np.linalg.norm(seen - place, axis=1).min() > 1e-5]
    assert len(names) == 2 and lost == []


def test_copy_is_offset_in_space_and_time(performed):
    project, chair = performed
    twice, second = copy(project, chair, offset=np.array([1.0, 0.0, 0.0]), delay=0.2)
    here, there = mesh_at(twice, chair, 0.1).vertices, mesh_at(twice, second, 0.3).vertices
    np.testing.assert_allclose(there, here + np.array([1.0, 0.0, 0.0]), atol=1e-6)


def test_matches_equal_those_of_the_matcher():
    skeleton = _skeleton()
    body = standing(0.7)
    expected = Matcher(skeleton).rank(body_source(body, "arms").source.points(body.joints), ScreenView())
    matches = match(body, skeleton, "arms")
    assert [each.key for each in matches] == [each.key for each in expected]
    assert (matches.scores == expected.scores).all()


def _skeleton():
    names = ("root", "left", "left end", "right", "right end", "up", "up end")
    places = np.array([[0, 0, 0], [1, 0, 0], [2, 0.2, 0], [-1, 0, 0], [-2, 0, 0], [0, 1, 0], [0, 2, 0.0]])
    return Skeleton(names, np.array([-1, 0, 1, 0, 3, 0, 5]), places)


def test_impossible_edit_is_refused_with_a_fix(performed, tmp_path):
    project, chair = performed
    far = standing()
    far = replace(far, joints=far.joints + 9.0)
    for refused, advice in (
        (lambda: possess(load_sample("chair"), [standing()]), "Pass more bodies"),
        (lambda: possess(load_sample("chair"), [far, far]), "fit_height"),
        (lambda: mesh_at(project, "table", 0.0), chair),
        (lambda: cut(project, "table", PlaneCut(np.zeros(3), np.ones(3)), 0.0), chair),
        (lambda: copy(project, "table"), chair),
        (lambda: merge(project, chair, chair, 0.0), "Copy the character first"),
        (lambda: export(project, tmp_path / "chair.doc"), ".glb"),
        (lambda: export(project, tmp_path / "chair.bvh"), ""),
    ):
        with pytest.raises(InputError) as refusal:
            refused()
        assert advice in refusal.value.remedy
    assert list(tmp_path.iterdir()) == []


def test_examples_with_an_unknown_joint_are_refused():
    chair = load_sample("chair")
    take = clip_of_bodies([standing(0.2 * n) for n in range(6)], STEP * np.arange(6), "bow")
    points = {"seat": (0, "hip center"), "arm": (9, "left hand")}
    rest = chair.vertices[[0, 9]]
    with pytest.raises(InputError, match="define no motion") as caught:
        fit_examples(chair, take, points, {0.0: rest, 0.2: rest + 0.1})
    assert "has no 'left hand'" in caught.value.remedy and "hand left" in caught.value.remedy
