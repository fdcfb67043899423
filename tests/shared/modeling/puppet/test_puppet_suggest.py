"""Tests of the suggested puppet: symmetric, paired by side and height, and complete except for its key
poses.
"""

import numpy as np
import pytest
from puppet_worlds import JOINTS, nearest, stool, walker
from sample_meshes.cactus import make_cactus

from enliven.document.project import Project
from enliven.errors import InputError
from enliven.examples.coverage import describe_unposed
from enliven.examples.puppet_examples import find_missing_examples
from enliven.examples.puppet_motion import evaluate_state
from enliven.modeling.puppet.edits import make_puppet
from enliven.modeling.puppet.points import add_point, change_point
from enliven.modeling.puppet.suggest import (
    suggest_extremities,
    suggest_joint,
    suggest_pairs,
    suggest_puppet,
)


def suggested(mesh, **how):
    return suggest_puppet(Project().with_takes(walker()), mesh, "walk", "it", **how)


@pytest.mark.slow
def test_the_studio_and_the_command_suggest_the_same():
    """The studio's panel suggests points and then pairs. The result equals the puppet that the command
    makes.
    """
    cactus = suggested(make_cactus(), points=6, poses=2).puppets["it"]
    project = make_puppet(Project().with_takes(walker()), make_cactus(), "it")
    for vertex in suggest_extremities(cactus.mesh, 6):
        project = add_point(project, "it", vertex)
    pairs = suggest_pairs(project, "it", "walk")
    points = {point.name: point for point in project.puppets["it"].points}
    placements = {(points[pair.point].vertex, pair.joint, pair.foot) for pair in pairs}
    assert {(point.vertex, point.joint, point.foot) for point in cactus.points} <= placements


def test_suggestion_keeps_pairs_and_mirrors_them():
    project = make_puppet(Project().with_takes(walker()), stool(), "it")
    for place in ([0.3, 0.6, 0], [-0.3, 0.6, 0], [0.3, 0, 0.2], [-0.3, 0, 0.2], [0, 1, 0]):
        project = add_point(project, "it", nearest(stool(), place))
    names = [point.name for point in project.puppets["it"].points]
    project = change_point(project, "it", names[1], joint="RightFoot")
    pairs = {pair.point: pair.joint for pair in suggest_pairs(project, "it", "walk")}
    assert names[1] not in pairs and pairs[names[0]] == "LeftFoot"
    assert {pairs[names[2]], pairs[names[3]]} == {"LeftHand", "RightHand"}
    assert suggest_joint(project, "it", "walk", names[1]) == "RightHand"


@pytest.mark.slow
def test_suggested_puppet_only_needs_poses():
    project = suggested(make_cactus(), points=6, poses=4)
    puppet = project.puppets["it"]
    assert find_missing_examples(project, puppet) == () and describe_unposed(puppet)
    assert len(puppet.poses) == 4 and len(puppet.points) >= 4
    # It stands on a single pot, and no leg is paired with the pot.
    assert not any(point.foot for point in puppet.points if point.joint == "Hips")
    assert {point.joint for point in puppet.points} <= set(JOINTS)
    tall = puppet.mesh.bounds[1, 1]
    assert max(puppet.rest[:, 1]) > 0.9 * tall
    now = evaluate_state(project, puppet, 1.0)
    np.testing.assert_allclose(now.places, puppet.rest, atol=1e-9)
    hands = {point.joint: place for point, place in zip(puppet.points, puppet.rest, strict=True)}
    assert hands["LeftHand"][0] > 0.2 > -0.2 > hands["RightHand"][0]


def test_feet_are_low_and_follow_legs():
    puppet = suggested(stool(), points=8, poses=2).puppets["it"]
    feet = [point for point in puppet.points if point.foot]
    assert feet
    for point in feet:
        assert puppet.mesh.vertices[point.vertex, 1] < 0.1 and "Foot" in point.joint


@pytest.mark.parametrize("how", [{"points": 0}, {"poses": 1}])
def test_too_few_are_refused(how):
    with pytest.raises(InputError, match="too few"):
        suggested(stool(), **how)


def test_motionless_take_is_refused():
    clip = walker()
    still = type(clip)("still", clip.skeleton, clip.turns[[0, 0]], clip.root[[0, 0]], clip.step)
    with pytest.raises(InputError, match="the performer does not move"):
        suggest_puppet(Project().with_takes(still), stool(), "still", "it")
