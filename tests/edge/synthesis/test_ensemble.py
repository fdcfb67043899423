"""Tests of several performers in one scene: the ground truth agrees with the image and with ray casting."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest
from tolerances import assert_alike

from enliven.person.joints import Joint
from enliven_synthesis.body.body_sdf import BodyAnatomy
from enliven_synthesis.body.performer import Performer, Proportions
from enliven_synthesis.body.visibility import MAX_COVER_M
from enliven_synthesis.motion.exercises import get_exercise
from enliven_synthesis.motion.motion import (
    DanceMotion,
    FrozenMotion,
    MotionSegment,
    MotionSequence,
    place_figure,
)
from enliven_synthesis.sensor.ensemble import Appearance, Ensemble
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.scene import Box

sys.path.insert(0, str(Path(__file__).parent))
from test_rendering import slow_field

TOF = load_profile("tof")
DESK = Box((-0.8, 0.0, -2.0), (0.8, 0.75, -1.9))


def appearance(name: str, build: Proportions | None = None, **more) -> Appearance:
    performer = Performer(build)
    return Appearance(performer, DanceMotion(performer, get_exercise(name)), **more)


def hidden_by_ray(scene: Ensemble, figures, p: int, joint: int, boxes) -> bool:
    """Returns True if a ray to the joint hits a box, another body, or the same body well before the joint."""
    target = scene.camera_from_world[:3, :3] @ figures[p].joints[joint] + scene.camera_from_world[:3, 3]
    performer = scene.cast[p].performer
    thick = MAX_COVER_M[joint] * performer.scale * max(1.0, performer.proportions.girth)
    steps = np.arange(0.3, target[2] - thick, 0.004)
    points = target[None] / target[2] * steps[:, None]
    for figure, other in zip(figures, scene.cast, strict=True):
        sdf = BodyAnatomy(other.performer).place(figure, scene.camera_from_world)
        if (slow_field(sdf, points) < 0).any():
            return True
    world = points @ scene.world_from_camera[:3, :3].T + scene.world_from_camera[:3, 3]
    return any(((world > box.low) & (world < box.high)).all(1).any() for box in boxes)


@pytest.mark.parametrize("frame", [15, 80, 130])
def test_visibility_agrees_with_a_slow_ray(frame: int) -> None:
    """Joints at an occlusion boundary may differ. Nearly all others agree."""
    cast = (
        appearance("crossed", place=(-0.1, -2.9), yaw=0.4),
        appearance("overhead", Proportions(1.9, 0.9), place=(0.45, -3.4)),
    )
    scene = Ensemble(TOF, cast, room=(DESK,), noise=False)
    time = frame / scene.rate
    figures = [a.figure(time) for a in cast]
    _, truth = scene.frame(frame)
    agree = [
        truth.visible[p, j] == (not hidden_by_ray(scene, figures, p, j, (DESK,)))
        for p in range(2)
        for j in range(20)
    ]
    assert truth.visible.sum() > 15
    assert (~truth.visible).sum() > 4  # the desk occludes the legs
    assert np.mean(agree) >= 0.9


def test_performer_behind_another_is_occluded() -> None:
    cast = (
        appearance("still", Proportions(1.9, 1.3), place=(0.0, -2.2)),
        appearance("still", place=(0.0, -3.2)),
    )
    _, truth = Ensemble(TOF, cast, noise=False).frame(0)
    assert truth.visible[0].mean() > 0.85
    assert truth.visible[1].mean() < 0.3
    assert (truth.owner == 0).sum() > 10 * (truth.owner == 1).sum()


def test_the_back_does_not_hide_the_chest_but_hides_folded_hands() -> None:
    performer = Performer()
    held = FrozenMotion(DanceMotion(performer, get_exercise("crossed")), 1.7, 0.0)
    front = Ensemble(TOF, (Appearance(performer, held),), noise=False).frame(0)[1].visible[0]
    back = Ensemble(TOF, (Appearance(performer, held, yaw=np.pi),), noise=False).frame(0)[1].visible[0]
    for joint in (Joint.HEAD, Joint.SHOULDER_LEFT, Joint.HIP_LEFT, Joint.KNEE_LEFT, Joint.KNEE_RIGHT):
        assert front[joint] and back[joint]
    assert front[Joint.HAND_LEFT] or front[Joint.HAND_RIGHT]
    assert not back[Joint.HAND_LEFT] and not back[Joint.HAND_RIGHT]


def test_out_of_the_image_or_of_range_is_not_visible() -> None:
    aside = Ensemble(TOF, (appearance("still", place=(4.0, -2.7)),), noise=False, room=()).frame(0)[1]
    assert aside.present[0] and not aside.visible.any()
    far = Ensemble(TOF, (appearance("still", place=(0.0, -5.5)),), noise=False, room=()).frame(0)[1]
    assert not far.visible.any()  # The profile's range ends at 5 m.


def test_absent_performer_has_no_joints() -> None:
    scene = Ensemble(TOF, (appearance("still", present=(0.2, 0.5)),), noise=False)
    there = [scene.frame(n)[1] for n in (0, 10, 20)]
    assert [bool(t.present[0]) for t in there] == [False, True, False]
    assert np.isnan(there[0].joints).all() and np.isfinite(there[1].joints).all()
    assert there[0].bodies() == [] and [b.id for b in there[1].bodies()] == [1]
    assert (there[0].owner == -1).all()


def test_the_same_number_gives_the_same_frame() -> None:
    def make() -> Ensemble:
        return Ensemble(TOF, (appearance("signals"),), seed=3, told=False)

    first, second = make(), make()
    second.frame(3)
    a, b = first.frame(12), second.frame(12)
    np.testing.assert_array_equal(a[0].depth, b[0].depth)
    np.testing.assert_array_equal(a[1].joints, b[1].joints)
    assert a[0].world_from_camera is None
    assert not np.array_equal(a[0].depth, first.frame(13)[0].depth)


def test_feet_stand_until_they_step() -> None:
    performer = Performer()
    moves = get_exercise("stroll")
    scene = Ensemble(TOF, (Appearance(performer, DanceMotion(performer, moves), (0.0, -4.0)),), noise=False)
    agree = []
    for n in range(0, 120, 3):
        contacts = scene.frame(n)[1].contacts[0]
        agree += [contacts[side] == moves.planted(side, n / scene.rate) for side in (0, 1)]
    assert np.mean(agree) > 0.9


def test_a_chain_goes_on_where_it_is_told() -> None:
    performer = Performer()
    still = DanceMotion(performer, get_exercise("still"))
    chain = MotionSequence(
        performer,
        (MotionSegment(0.0, still, (1.0, -3.0)), MotionSegment(2.0, still, (1.0, -3.0), 1.0)),
        blend=1.0,
    )
    assert chain.duration == pytest.approx(2.0 + still.duration)
    np.testing.assert_allclose(
        chain.figure(0.5).joints, place_figure(still.figure(0.5), (1.0, -3.0), 0.0).joints
    )
    np.testing.assert_allclose(
        chain.figure(2.5).joints, place_figure(still.figure(0.5), (1.0, -3.0), 1.0).joints
    )
    times = np.arange(0.9, 2.1, 1 / 60)
    joints = np.stack([chain.figure(t).joints for t in times])
    assert np.abs(np.diff(joints, axis=0)).max() < 0.06
    assert all(abs(performer.soles(chain.figure(t)).min()) < 0.01 for t in times)


def test_a_knocked_sensor_sees_the_same_world() -> None:
    upright = Ensemble(TOF, (appearance("still"),), noise=False)
    rolled = Ensemble(TOF, (appearance("still"),), noise=False, tilt=12.0, roll=8.0, height=1.1)
    assert_alike(upright.frame(4)[1].joints, rolled.frame(4)[1].joints)
    assert not np.array_equal(upright.frame(4)[0].depth, rolled.frame(4)[0].depth)


def test_settings_of_the_scene_are_kept() -> None:
    scene = Ensemble(dataclasses.replace(TOF, name="other"), (appearance("still"),), rate=10.0)
    assert scene.time_ns(5) == 500_000_000
    assert scene.frame(0)[0].sensor == "synthetic other"
