"""Tests that after a quick half turn, a person is neither back to front nor twisted."""

import numpy as np
import pytest

from enliven.person import Joint
from enliven_edge.tracking.tracker import Tracker

FPS = 30
SWEEP = 1.0 / 3.0
"""Duration of a half turn in seconds."""
BEGINS = 0.7
RECOVERED = 10
"""Frames after the turn until the body must be correct."""
WRONG_WAY = np.radians(45.0)
TWIST = np.radians(50.0)
"""Maximum angle between shoulders and hips, seen from above: the chest's range of 43 degrees, plus noise."""


def heading(joints, left: Joint, right: Joint) -> float:
    """Returns the direction of the line from a right to a left joint, seen from above, radians."""
    across = joints[left] - joints[right]
    return float(np.arctan2(across[2], across[0]))


def apart(one: float, other: float) -> float:
    return abs((one - other + np.pi) % (2.0 * np.pi) - np.pi)


@pytest.mark.parametrize(("does", "yaw", "way"), [("idle", 0.3, 1.0), ("walk", np.pi, -1.0)])
def test_the_body_faces_the_right_way_after_a_quick_half_turn(stagecraft, does, yaw, way):
    def where(time):
        share = min(1.0, max(0.0, (time - BEGINS) / SWEEP))
        return 0.0, -2.7, yaw + way * np.pi * share * share * (3.0 - 2.0 * share)

    stage = stagecraft.Playground(stagecraft.Player(where, does))
    tracker, first = Tracker(), round((BEGINS + SWEEP) * FPS) + RECOVERED
    for n in range(first + 12):
        bodies = tracker.track(stage.frame(n / FPS))
        if n < first:
            continue
        (body,), (true,) = bodies, stage.joints(n / FPS)
        shoulders = heading(body.joints, Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT)
        hips = heading(body.joints, Joint.HIP_LEFT, Joint.HIP_RIGHT)
        assert apart(shoulders, heading(true, Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT)) < WRONG_WAY, n
        assert apart(hips, heading(true, Joint.HIP_LEFT, Joint.HIP_RIGHT)) < WRONG_WAY, n
        assert apart(shoulders, hips) < TWIST, n
