"""Tests of clips of files and of tracked people: forward kinematics reproduces the input joints."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion_strategies import EYE, angle, random_clip, random_skeleton, random_turn, seeds
from tolerances import are_alike

from enliven.document.clip import Clip
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.formats.motion.capture import Capture, forward_kinematics
from enliven.motion_clips.capture_clip import clip_of_capture
from enliven.motion_clips.clip_sampling import evenly_sampled_clip, trim_clip
from enliven.motion_clips.joint_positions import clip_of_bodies, rotations_from_positions
from enliven.person.body import Body
from enliven.person.joints import PARENTS, Joint
from enliven.rotation import from_rotation_vector, multiply, rotate, slerp, to_matrix

laws = settings(deadline=None, max_examples=25)

_TRUNK = [[0, 0.95, 0], [0, 1.05, 0], [0, 1.4, 0], [0, 1.6, 0]]
_ARM = np.array([[0.2, 1.4, 0], [0.22, 1.12, 0], [0.22, 0.88, 0], [0.22, 0.8, 0]])
_LEG = np.array([[0.1, 0.9, 0], [0.1, 0.5, 0], [0.1, 0.1, 0], [0.1, 0.05, 0.1]])
STANDING = np.concatenate([_TRUNK, _ARM, _ARM * [-1, 1, 1], _LEG, _LEG * [-1, 1, 1]])
"""(20, 3) joints of a standing person with hanging arms."""


def joints_of(clip):
    """Returns (F, N, 3) joint positions of the clip."""
    at = np.empty((len(clip.turns), len(clip.skeleton), 3))
    at[:, 0] = clip.root
    for j, parent in enumerate(clip.skeleton.parents):
        if parent >= 0:
            at[:, j] = at[:, parent] + rotate(clip.turns[:, j], clip.skeleton.vectors[j])
    return at


def a_capture(rng, unit=1.0, carrier=False):
    """Returns a walk of a person of 20 joints in a file's units. With ``carrier``, a joint on the floor is
    the root.
    """
    frames, offsets = (
        12,
        STANDING - np.where(np.array(PARENTS)[:, None] < 0, 0, STANDING[np.maximum(PARENTS, 0)]),
    )
    own = from_rotation_vector(0.4 * np.sin(np.arange(frames)[:, None, None] / 3 + rng.normal(size=(20, 3))))
    own[:, 1:4] = from_rotation_vector(0.05 * rng.normal(size=(3, 3)))
    rotations = to_matrix(own)
    rotations[:, 0] = np.eye(3)
    offsets = np.tile(offsets * unit, (frames, 1, 1))
    offsets[:, 0, 2] += np.linspace(0, 1, frames) * unit
    positions, world = forward_kinematics(PARENTS, offsets, rotations)
    names, parents = tuple(f"joint {i}" for i in range(20)), PARENTS
    if carrier:
        names, parents = ("carrier", *names), (-1, *(p + 1 for p in parents))
        positions = np.concatenate([np.zeros((frames, 1, 3)), positions], 1)
        world = np.concatenate([np.tile(np.eye(3), (frames, 1, 1, 1)), world], 1)
    return Capture(names, parents, positions, world, 0.05)


@laws
@given(seeds, st.sampled_from([1.0, 100.0, 39.37]), st.booleans(), st.sampled_from(["auto", "first", 3]))
def test_a_capture_is_its_joints_in_metres(seed, unit, carrier, rest):
    capture = a_capture(np.random.default_rng(seed), unit, carrier)
    clip = clip_of_capture(capture, "take", rest=rest)
    assert clip.skeleton.names == tuple(f"joint {i}" for i in range(20)) and clip.step == 0.05
    inches = 0.0254 * unit if unit == 39.37 else 1.0
    expected = capture.positions[:, -20:] / unit * inches
    np.testing.assert_allclose(joints_of(clip), expected, atol=1e-9)
    at_rest = {"first": 0, 3: 3}.get(rest)
    if at_rest is not None:
        np.testing.assert_allclose(clip.skeleton.positions, expected[at_rest], atol=1e-9)
        assert angle(clip.turns[at_rest], np.tile(EYE, (20, 1))) < 1e-6


def test_standing_zero_pose_is_the_rest_pose():
    capture = a_capture(np.random.default_rng(0))
    clip = clip_of_capture(capture, "take")
    floor = np.percentile(capture.positions[:, :, 1].min(1), 10)
    expected = STANDING + np.array([0, floor - 0.05, 0])
    np.testing.assert_allclose(clip.skeleton.positions, expected, atol=1e-9)
    # If the zero pose lies on its back, the first frame is the rest pose instead.
    lying = to_matrix(from_rotation_vector([-np.pi / 2, 0, 0]))
    offsets = np.tile(np.eye(3), (len(capture.positions), 20, 1, 1))
    down = Capture(
        capture.names,
        capture.parents,
        capture.positions,
        capture.rotations @ lying.T[None, None] @ offsets,
        0.05,
    )
    np.testing.assert_allclose(
        clip_of_capture(down, "take").skeleton.positions, capture.positions[0], atol=1e-9
    )


def test_invalid_file_options_are_refused():
    capture = a_capture(np.random.default_rng(0))
    with pytest.raises(InputError, match="rest pose 12 does not exist"):
        clip_of_capture(capture, "take", rest=12)
    with pytest.raises(InputError, match="unit 'elbow' is unknown"):
        clip_of_capture(capture, "take", unit="elbow")
    with pytest.raises(InputError, match="m is not valid"):
        clip_of_capture(capture, "take", unit=0.0)
    two = Capture(("a", "b"), (-1, -1), np.zeros((1, 2, 3)), np.tile(np.eye(3), (1, 2, 1, 1)), 0.1)
    with pytest.raises(InputError, match="more than one root"):
        clip_of_capture(two, "take")
    assert clip_of_capture(capture, "take", unit=0.5).root[0, 1] == pytest.approx(
        capture.positions[0, 0, 1] / 2
    )


@laws
@given(seeds)
def test_positions_alone_give_turns_that_put_the_joints_there(seed):
    rng = np.random.default_rng(seed)
    skeleton = random_skeleton(rng, 8)
    truth = joints_of(random_clip(rng, skeleton))
    clip = Clip("take", skeleton, rotations_from_positions(skeleton, truth, None), truth[:, 0], 0.1)
    np.testing.assert_allclose(joints_of(clip), truth, atol=1e-6)


@laws
@given(seeds)
def test_a_whole_that_turns_is_one_turn(seed):
    # Every bone of a rigid body of points gets the very rotation: pelvis and chest are fitted, not swung.
    rng = np.random.default_rng(seed)
    skeleton = Skeleton(tuple(f"j{i}" for i in range(20)), np.array(PARENTS, np.int32), STANDING)
    by = random_turn(rng)
    turns = rotations_from_positions(skeleton, rotate(by, STANDING)[None])
    assert angle(turns[0], np.tile(by, (20, 1))) < 1e-6


def test_shoulders_turn_the_chest():
    skeleton = Skeleton(tuple(f"j{i}" for i in range(20)), np.array(PARENTS, np.int32), STANDING)
    now, twist = STANDING.copy(), from_rotation_vector([0, 0.7, 0])
    above = [3, *range(4, 12)]
    now[above] = now[2] + rotate(twist, now[above] - now[2])
    turns = rotations_from_positions(skeleton, now[None])[0]
    assert angle(turns[2], twist) < 1e-9 and angle(turns[0], EYE) < 1e-9


def bodies_of(rng, frames=10, oriented=False):
    bodies = []
    for i in range(frames):
        joints = STANDING.copy()
        swing = from_rotation_vector([-0.3 * i, 0, 0])
        joints[5:8] = joints[4] + rotate(swing, STANDING[5:8] - STANDING[4])
        joints += [0, 0, 0.1 * i]
        turns = np.tile(EYE, (20, 1))
        turns[5] = swing
        turns[6:8] = multiply(swing, from_rotation_vector([0, 0.1 * i, 0]))
        bodies.append(Body(1, joints, np.ones(20), turns if oriented else None))
    return bodies


@pytest.mark.parametrize("oriented", [False, True])
def test_bodies_become_a_clip_at_an_even_rate(oriented):
    bodies = bodies_of(np.random.default_rng(0), oriented=oriented)
    times = np.cumsum([5.0, *np.tile([0.02, 0.04], 5)[:9]])
    clip = clip_of_bodies(bodies, times, "take", step=0.01)
    assert clip.skeleton.names[4] == "shoulder left" and len(clip.turns) == 27
    np.testing.assert_allclose(clip.skeleton.positions, STANDING, atol=1e-12)
    at = joints_of(clip)
    for body, seconds in zip(bodies, times - 5.0, strict=True):
        frame = round(seconds / 0.01)
        np.testing.assert_allclose(at[frame], body.joints, atol=1e-6)
        if oriented:
            assert angle(clip.turns[frame], body.orientations) < 1e-6
    # Half of the time is half of the rotation.
    assert angle(clip.turns[1, 5], slerp(clip.turns[0, 5], clip.turns[2, 5], 0.5)) < 1e-6


def test_the_rest_of_bodies_may_be_any_moment_or_another_body():
    bodies = bodies_of(np.random.default_rng(0))
    times = np.arange(10) * 0.1
    later = clip_of_bodies(bodies, times, "take", rest=4, step=0.1)
    assert angle(later.turns[4], np.tile(EYE, (20, 1))) < 1e-6
    np.testing.assert_allclose(later.skeleton.positions, bodies[4].joints, atol=1e-9)
    other = clip_of_bodies(bodies[3:], times[3:], "take", rest=bodies[0], step=0.1)
    np.testing.assert_allclose(other.skeleton.positions, STANDING, atol=1e-9)
    np.testing.assert_allclose(joints_of(other)[2], bodies[5].joints, atol=1e-6)


def test_a_joint_that_was_not_seen_comes_from_before_and_after():
    bodies = bodies_of(np.random.default_rng(0))
    lost = [bodies[i].joints.copy() for i in range(10)]
    lost[4][6:8] = 99.0
    confidence = np.ones(20)
    confidence[6:8] = 0.0
    held = [*bodies[:4], Body(1, lost[4], confidence), *bodies[5:]]
    clip = clip_of_bodies(held, np.arange(10) * 0.1, "take", step=0.1)
    assert np.linalg.norm(joints_of(clip)[4, Joint.HAND_LEFT] - bodies[4].joints[Joint.HAND_LEFT]) < 0.03


def test_bodies_and_times_must_fit():
    bodies = bodies_of(np.random.default_rng(0), 2)
    for some, times in (([], []), (bodies, [0.0]), (bodies, [1.0, 1.0])):
        with pytest.raises(InputError, match="times"):
            clip_of_bodies(some, times, "take")


@laws
@given(seeds, st.sampled_from([0.5, 0.25, 1.0]))
def test_resampling_keeps_the_frames_and_puts_slerps_between(seed, part):
    rng = np.random.default_rng(seed)
    clip = random_clip(rng, random_skeleton(rng, 5))
    times = np.arange(len(clip.turns)) * clip.step
    finer = evenly_sampled_clip("take", clip.skeleton, times, clip.turns, clip.root, clip.step * part)
    every = round(1 / part)
    assert len(finer.turns) == 8 * every + 1 and finer.duration == pytest.approx(clip.duration)
    assert angle(finer.turns[::every], clip.turns) < 1e-6
    np.testing.assert_allclose(finer.root[::every], clip.root, atol=1e-9)
    if every > 1:
        assert angle(finer.turns[1], slerp(clip.turns[0], clip.turns[1], part)) < 1e-6
    assert ((finer.turns[1:] * finer.turns[:-1]).sum(-1) >= 0).all()


def test_a_part_of_a_clip():
    rng = np.random.default_rng(0)
    clip = random_clip(rng, random_skeleton(rng, 3))
    part = trim_clip(clip, 2 * clip.step, 5 * clip.step)
    assert are_alike(part.turns, clip.turns[2:6]) and are_alike(part.root, clip.root[2:6])
    assert len(trim_clip(clip, 99.0, 100.0).turns) == 1
