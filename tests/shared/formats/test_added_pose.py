"""Tests that a rest pose added before captured motion is found and left out, but motion never is."""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document.clip import joint_places
from enliven.formats.motion.added_pose import count_added_frames, remove_added_poses
from enliven.formats.motion.bvh import read_bvh
from enliven.motion_clips.take_files import read_take
from enliven.rotation import from_rotation_vector, multiply, rotate

sys.path.insert(0, str(Path(__file__).parents[1] / "mapping"))
from made_bodies import bvh_text, man, walk

STEP = 1 / 60


def moving(seed, seconds=1.5, reach=1.2):
    """Returns (F, N, 3) metres of a man that starts in a separate pose and then bends all joints smoothly."""
    random, skeleton = np.random.default_rng(seed), man()
    times, count = np.arange(round(seconds / STEP)) * STEP, len(skeleton)
    axes, about = random.normal(size=(count, 3)) * reach / 2, random.normal(size=(count, 3)) * 0.4
    rate, phase = random.uniform(0.3, 0.9, count), random.uniform(0.0, 6.0, count)
    places = np.zeros((len(times), count, 3))
    for f, t in enumerate(times):
        turns = np.empty((count, 4))
        for j in range(count):
            own = from_rotation_vector(about[j] + axes[j] * np.sin(2 * np.pi * rate[j] * t + phase[j]))
            turns[j] = own if j == 0 else multiply(turns[skeleton.parents[j]], own)
        places[f] = posed(skeleton, turns)
    return places


def posed(skeleton, turns):
    ways = rotate(turns, skeleton.vectors)
    at = np.zeros((len(skeleton), 3))
    for j in range(1, len(skeleton)):
        at[j] = at[skeleton.parents[j]] + ways[j]
    return at


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 10_000), held=st.integers(1, 40), at_end=st.booleans())
def test_added_pose_is_left_out_at_any_length(seed, held, at_end):
    motion, rest = moving(seed), man().positions - man().positions[0]
    added = np.repeat(rest[None], held, 0)
    both = np.concatenate([motion, added] if at_end else [added, motion])
    assert count_added_frames(both, STEP) == ((0, held) if at_end else (held, 0))


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 10_000), coarse=st.integers(1, 4))
def test_real_motion_is_kept_completely(seed, coarse):
    """At 60 to 15 frames a second, with the pose of its first frame as rest pose or without."""
    motion = moving(seed, 2.0)[::coarse]
    assert count_added_frames(motion, STEP * coarse) == (0, 0)
    assert count_added_frames(motion, STEP * coarse, motion[0]) == (0, 0)


@pytest.mark.parametrize("fade", [2, 4])
def test_a_rest_pose_that_fades_into_the_motion_is_left_out(fade):
    """Resampling has spread the jump from the rest pose over some frames."""
    motion, rest = moving(7, reach=0.2)[::2], man().positions - man().positions[0]
    share = np.arange(fade)[:, None, None] / fade
    faded = (1.0 - share) * rest + share * motion[:1]
    both = np.concatenate([faded, motion])
    assert abs(count_added_frames(both, 2 * STEP, rest)[0] - fade) <= 1
    assert count_added_frames(both, 2 * STEP)[0] in (0, fade), "half of a jump is never left out"


def test_a_motion_that_begins_fast_is_kept():
    """The motions are a kick within the first frames, and a person that starts to run."""
    motion, times = moving(3), np.arange(90)[:, None, None] * STEP
    kick = np.exp(-((times - 0.05) ** 2) / 0.005) * [0.0, 0.2, 0.4]
    kicked = motion.copy()
    kicked[:, -1:] += kick
    assert count_added_frames(kicked, STEP) == (0, 0)
    assert count_added_frames(motion + times * [9.0, 0.0, 0.0], STEP) == (0, 0)


def test_a_short_or_still_take_is_kept():
    still = np.repeat(moving(1)[:1], 30, 0)
    assert count_added_frames(still, STEP) == (0, 0)
    assert count_added_frames(moving(1)[::30], STEP) == (0, 0)


def test_omitted_pose_is_reported_and_rest_pose_kept(tmp_path):
    random, skeleton, path = np.random.default_rng(1), man(), tmp_path / "take.bvh"
    count, times = len(skeleton), np.linspace(0.0, 1.0, 30)[:, None, None]
    plain = random.normal(size=(count, 3)) * 50.0 + 10.0 * np.sin(
        3.0 * times + random.normal(size=(count, 3))
    )
    clips = []
    for added in (0, 1):
        values = np.concatenate([np.zeros((added, count, 3)), plain])
        path.write_text(bvh_text(skeleton, values))
        clip, notes = read_take(path)
        assert ["left out" in note for note in notes] == [True] * added
        assert remove_added_poses(read_bvh(path)).frames == len(clip.turns) == 30
        clips.append(clip)
    np.testing.assert_allclose(clips[1].turns, clips[0].turns, atol=1e-9)
    np.testing.assert_allclose(clips[1].skeleton.vectors, clips[0].skeleton.vectors, atol=1e-9)


def test_a_walk_of_the_tests_is_kept():
    assert count_added_frames(joint_places(walk(0.4)), walk(0.4).step) == (0, 0)
