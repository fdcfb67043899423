"""Tests of bones at a fork: a joint's vertices follow the straightest continuation, or get a bone of their
own.
"""

import numpy as np
import pytest

from enliven.formats.rig.rig_links import LinkBody
from enliven.formats.rig.rig_tree import build_tree


def bodies(*joints):
    """Returns joints given as (name, parent, position), each of which moves part of the surface, without
    animation."""
    still = np.zeros((0, 4)), np.zeros((0, 3))
    return [LinkBody(name, above, np.array(at, float), *still, mass=1.0) for name, above, at in joints]


def follows(made, tree, name):
    number = next(k for k, each in enumerate(made) if each.name == name)
    return tree.skeleton.names[tree.bone[number]]


def test_head_with_two_ears_keeps_its_own_bone():
    skeleton_bodies = bodies(
        ("hips", -1, (0, 0, 0)),
        ("neck", 0, (0, 1, 0)),
        ("head", 1, (0, 1.3, 0)),
        ("ear.L", 2, (0.3, 1.9, 0)),
        ("ear.R", 2, (-0.3, 1.9, 0)),
    )
    tree = build_tree(skeleton_bodies, 2.0)
    assert follows(skeleton_bodies, tree, "head") == "head end"
    own = tree.skeleton.index("head end")
    assert tree.driver[own] == 2
    assert tree.skeleton.names[tree.skeleton.parents[own]] == "head"
    assert tree.skeleton.lengths[own] == pytest.approx(0.4 * 0.3)


@pytest.mark.parametrize("arms", [0.1, 0.3])
def test_a_chest_follows_the_neck_not_a_shoulder(arms):
    """Shoulders with longer arms also continue nearly straight, but they are a pair, and the neck is between
    them.
    """
    skeleton_bodies = bodies(
        ("hips", -1, (0, 0, 0)),
        ("spine", 0, (0, 0, 0.5)),
        ("chest", 1, (0, 0, 1)),
        ("neck", 2, (0, 0, 1.6)),
        ("arm.L", 2, (arms, 0, 1.8)),
        ("arm.R", 2, (-arms, 0, 1.8)),
        ("hand.L", 4, (arms, -1, 1.8)),
        ("hand.R", 5, (-arms, -1, 1.8)),
    )
    assert follows(skeleton_bodies, build_tree(skeleton_bodies, 3.0), "chest") == "neck"


def test_a_joint_that_only_forks_gets_no_bone():
    skeleton_bodies = bodies(
        ("hips", -1, (0, 0, 0)), ("a", 0, (0, 1, 0)), ("b", 1, (1, 2, 0)), ("c", 1, (-1, 2, 0))
    )
    skeleton_bodies[1].mass = 0.0
    assert "a end" not in build_tree(skeleton_bodies, 2.0).skeleton.names
