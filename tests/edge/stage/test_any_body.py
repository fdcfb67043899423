"""Ten bodies that nobody tuned on wave as their performer does, limb for limb."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from known_bodies import BODIES, limbs_found

from enliven.deformation.graph import DeformationGraph
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven.possession import ActorSettings
from enliven.possession.likeness import find_body_in_mesh
from enliven_edge.stage.casting import cast_mesh
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing
from enliven_edge.tracking.body_model.posture import Posture, rotation

FRAME = 33_333_333
ARM = {"left": (model.UPPER_ARM_L, model.FOREARM_L, 1), "right": (model.UPPER_ARM_R, model.FOREARM_R, -1)}
FAR = 0.35
"""Metres from the bones of an arm, of a body of 1.75 m, beyond which nothing is its: a bear's is thick."""
STILL = 0.3
"""Share of the hand's way that anything far from the arm may move: a bear leans its head by 17 cm."""
SETTLED, WAVING = 75, 40
"""Frames until the mesh has come to its performer's pose, and of the wave."""


def waving(side: str, share: float) -> Body:
    """Standing with hanging arms; one arm lifts to the side and up, by a share, and the forearm beckons."""
    upper, fore, sign = ARM[side]
    rotations = standing()
    rotations[upper] = rotation(z=sign * (0.12 + 2.1 * share))
    rotations[fore] = rotation(x=-0.15 - 0.5 * share)
    joints = Posture(np.array([0.0, 1.0, -2.5]), rotations, model.lengths_for_height(1.75)).joints()
    return Body(1, joints, np.ones(20), stature=1.75)


@pytest.fixture(scope="module", params=BODIES)
def known(request):
    return BODIES[request.param]()


def test_all_limbs_are_found(known):
    like = find_body_in_mesh(known.mesh, DeformationGraph.build(known.mesh, nodes=32))
    assert like.human
    missed = [limb for limb, found in limbs_found(like.joints, known).items() if not found]
    assert not missed, f"{known.mesh.name}: {', '.join(missed)}"


@pytest.mark.parametrize("side", ARM)
def test_it_waves_when_its_performer_waves(known, side):
    actor = cast_mesh(known.mesh, "it", 128, ActorSettings(how="mapped", stand="modelled"))
    low, high = known.mesh.bounds
    size = 1.75 / (high[1] - low[1])
    joints = (known.joints - [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]) * size
    house = Stage([actor])
    house.perform([waving(side, 0.0)], 0)
    house.possess("it")
    for i in range(SETTLED):
        still = house.perform([waving(side, 0.0)], (i + 1) * FRAME)[0]
    for i in range(WAVING):
        pose = house.perform([waving(side, i / (WAVING - 1))], (SETTLED + i + 1) * FRAME)[0]
    moved = np.linalg.norm(pose.positions - still.positions, axis=1)
    arm = joints[[Joint[f"{name}_{side.upper()}"] for name in ("SHOULDER", "ELBOW", "WRIST", "HAND")]]
    hand = np.argsort(np.linalg.norm(actor.graph.positions - arm[3], axis=1))[:3]
    lengths = np.linalg.norm(np.diff(arm, axis=0), axis=1).sum()
    rose = (pose.positions - still.positions)[hand, 1].mean()
    assert rose > 0.9 * lengths, "the hand is lifted from below the shoulder to above it"
    far = np.ones(len(moved), bool)
    for a, b in itertools.pairwise(arm):
        for share in np.linspace(0, 1, 8):
            far &= np.linalg.norm(actor.graph.positions - a - share * (b - a), axis=1) > FAR
    assert far.sum() > 40
    assert moved[far].max() < STILL * moved[hand].mean(), "nothing else far away does"
