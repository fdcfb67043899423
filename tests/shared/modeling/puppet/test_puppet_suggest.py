"""A puppet to begin with: symmetric, paired by side and height, and ready but for its poses."""

import numpy as np
import pytest
from puppet_worlds import JOINTS, stool, walker
from sample_meshes.cactus import make_cactus

from enliven.document.project import Project
from enliven.errors import InputError
from enliven.examples.coverage import unposed
from enliven.examples.puppet_examples import missing
from enliven.examples.puppet_motion import state_of
from enliven.modeling.puppet.suggest import suggested_puppet, symmetric_joints

REST = np.array([[0.5, 1, 0], [-0.5, 1, 0], [0, 1.5, 0], [0.2, 0, 0], [-0.2, 0, 0]])
PARTNERS = (1, 0, 2, 4, 3)


def suggested(mesh, **how):
    return suggested_puppet(Project().with_takes(walker()), mesh, "walk", "it", **how)


def test_mirror_images_follow_the_joints_of_both_sides():
    guessed = ("LeftHand", "Spine", "RightHand", "RightFoot", "Head")
    made = symmetric_joints(walker().skeleton, guessed, REST, PARTNERS)
    assert made == ("LeftHand", "RightHand", "Head", "RightFoot", "LeftFoot")
    assert symmetric_joints(walker().skeleton, made, REST, PARTNERS) == made


def test_what_is_suggested_lacks_nothing_but_to_be_posed():
    project = suggested(make_cactus(), points=6, poses=4)
    puppet = project.puppets["it"]
    assert missing(project, puppet) == () and unposed(puppet)
    assert len(puppet.poses) == 4 and len(puppet.points) >= 4
    # It stands on one pot, and no leg is paired with that.
    assert not any(point.foot for point in puppet.points if point.joint == "Hips")
    assert {point.joint for point in puppet.points} <= set(JOINTS)
    tall = puppet.mesh.bounds[1, 1]
    assert max(puppet.rest[:, 1]) > 0.9 * tall
    now = state_of(project, puppet, 1.0)
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


def test_nobody_moves():
    clip = walker()
    still = type(clip)("still", clip.skeleton, clip.turns[[0, 0]], clip.root[[0, 0]], clip.step)
    with pytest.raises(InputError, match="the performer never moves"):
        suggested_puppet(Project().with_takes(still), stool(), "still", "it")
