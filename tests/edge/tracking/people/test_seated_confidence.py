"""Tests that legs have low confidence if a person sits on the floor, but not if they stand or lie."""

import numpy as np
import pytest

from enliven.person import Joint
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation
from enliven_edge.tracking.people.confidence import limit_when_seated

LEGS = [j for j in Joint if j.name.startswith(("KNEE", "ANKLE", "FOOT"))]
OTHERS = [j for j in Joint if j not in LEGS]


def posture(height: float, pitch: float = 0.0, **pose: float) -> Posture:
    """Returns a person with the hips at a height in metres, bent forward as a whole by ``pitch`` radians."""
    rotations = standing_pose(**pose)
    rotations[model.PELVIS] = rotation(x=pitch) @ rotations[model.PELVIS]
    return Posture(np.array([0.0, height, -2.5]), rotations, model.REFERENCE_LENGTHS.copy())


@pytest.mark.parametrize("sure", [0.95, 0.3])
def test_legs_of_a_seated_person_are_bounded(sure):
    bounded = limit_when_seated(np.full(20, sure), posture(0.15, hip=1.5))
    assert (bounded[LEGS] == min(sure, 0.7)).all()
    assert (bounded[OTHERS] == sure).all()


@pytest.mark.parametrize(
    "other",
    [posture(0.95), posture(0.5, knee=1.4), posture(0.15, pitch=1.5)],
    ids=["standing", "kneeling", "lying"],
)
def test_other_postures_keep_their_confidence(other):
    sure = np.linspace(0.0, 1.0, 20)
    np.testing.assert_array_equal(limit_when_seated(sure, other), sure)
