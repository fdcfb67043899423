"""Tests of a model's clips: which belong to it, which one it plays, and playing and exporting loops."""

from dataclasses import replace

import numpy as np
import pytest
from made_bodies import horse, man, random_motion, shape_with_markers

from enliven.document.project import Project
from enliven.errors import InputError
from enliven.exporters.sampling import sample_performance
from enliven.mapping.automatic_mapping import play_own_take, retarget
from enliven.mapping.model_clips import (
    clip_to_open,
    find_played_clip,
    is_looping,
    list_own_clips,
    loop_takes,
    mute_takes,
    play_own_clip,
)
from enliven.modeling.edits import key_handle, scale_character, turn_character
from enliven.motion.layers.evaluate import Player
from enliven.rotation import from_rotation_vector

QUARTER = from_rotation_vector(np.array([0.0, np.pi / 2, 0.0]))


def closed(clip):
    """Returns the clip with its first frame repeated at its end."""
    return clip.map_values(lambda track: np.concatenate([track, track[:1]]))


def clips_of(skeleton, seed=3):
    """Returns two clips of a skeleton: "once", which ends in another pose, and "round", which ends in its
    first pose.
    """
    random = np.random.default_rng(seed)
    once = random_motion(random, skeleton, 8, name="once")
    return once, closed(random_motion(random, skeleton, 6, name="round"))


def opened(name="round"):
    """Returns a project with a horse that plays one of its two clips."""
    project = Project().with_characters(shape_with_markers("horse", horse())).with_takes(*clips_of(horse()))
    return play_own_clip(project, "horse", name)


def test_a_clip_that_ends_in_its_first_pose_loops_wherever_it_went():
    once, around = clips_of(horse())
    assert is_looping(around) and not is_looping(once)
    way = np.linspace(0.0, 2.0, len(around.root))[:, None] * [1.0, 0.0, 0.3]
    assert is_looping(replace(around, root=around.root + way)), "a walk that goes on"
    risen = around.root + np.linspace(0.0, 2.0, len(around.root))[:, None] * [0.0, 1.0, 0.0]
    assert not is_looping(replace(around, root=risen)), "a jump that ends in the air"
    assert not is_looping(around.map_values(lambda track: track[:1]))


def test_a_model_opens_with_a_clip_that_moves_and_loops_the_idle_one_first():
    shape, (once, around) = shape_with_markers("horse", horse()), clips_of(horse())
    pose = once.map_values(lambda track: np.repeat(track[:1], 3, 0))
    idle = replace(around, id="Armature|Idle_2")
    other = clips_of(man())[1]
    assert clip_to_open(shape, [pose, once, around]) is around
    assert clip_to_open(shape, [once, around, idle]) is idle
    assert clip_to_open(shape, [pose, once]) is once
    assert clip_to_open(shape, [pose, other]) is None


def test_a_chosen_clip_plays_exactly_and_again_and_again():
    project = opened()
    shape, clip = project.shape("horse"), project.takes["round"]
    assert find_played_clip(project, shape) == "round" and set(list_own_clips(project, shape)) == {
        "once",
        "round",
    }
    times = np.arange(len(clip.turns)) * clip.step
    turns, joints = Player(project, "horse").sample(times)
    np.testing.assert_allclose(turns[:-1], clip.turns[:-1], atol=1e-12)
    later = Player(project, "horse").sample(times[:-1] + 2.0 * clip.duration)
    np.testing.assert_allclose(later[1], joints[:-1], atol=1e-9)
    with pytest.raises(InputError, match=r"not a clip.*once"):
        play_own_clip(project, "horse", "gallop")


def test_clips_are_changed_for_a_model_that_was_turned_and_scaled():
    """Rotating and scaling the model also rotates and scales its other clips."""
    moved = turn_character(scale_character(opened("once"), "horse", 2.0), "horse", QUARTER)
    moved = play_own_clip(moved, "horse", "round")
    assert find_played_clip(moved, moved.shape("horse")) == "round"
    before = play_own_clip(opened("once"), "horse", "round")
    after = turn_character(scale_character(before, "horse", 2.0), "horse", QUARTER)
    times = np.linspace(0.0, 0.4, 5)
    np.testing.assert_allclose(
        Player(moved, "horse").sample(times)[1], Player(after, "horse").sample(times)[1], atol=1e-9
    )


def test_no_clip_leaves_the_model_at_rest_and_keys_stay():
    project = opened()
    still = play_own_clip(project, "horse", None)
    assert find_played_clip(still, still.shape("horse")) is None
    np.testing.assert_allclose(Player(still, "horse").compute_pose(0.2).joints, horse().positions, atol=1e-12)
    back = play_own_clip(still, "horse", "once")
    assert find_played_clip(back, back.shape("horse")) == "once"
    keyed = key_handle(project, "horse", 3, [0.4, 0.9, 0.2], 0.1)
    changed = play_own_clip(keyed, "horse", "once")
    assert any(changed.takes[layer.take].keys for layer in changed.shape("horse").layers)


def test_a_shape_that_is_mapped_again_does_not_move_by_both():
    shape, clip = shape_with_markers("man", man()), clips_of(man())[0]
    alone = retarget(shape, clip).project
    again = mute_takes(play_own_take(shape, clip).project, "man")
    again = retarget(again.shape("man"), clip, project=again).project
    times = np.linspace(0.0, clip.duration, 6)
    np.testing.assert_allclose(
        Player(again, "man").sample(times)[1], Player(alone, "man").sample(times)[1], atol=1e-9
    )


def test_loops_are_exported_until_everything_else_has_ended_and_to_the_end_of_a_round():
    project, clip = opened(), clips_of(horse())[1]
    alone = sample_performance(project, "horse")
    assert alone.times[-1] == pytest.approx(clip.duration, abs=1e-9), "one round, with a frame at its end"
    np.testing.assert_allclose(alone.joints[-1], alone.joints[0], atol=1e-9)
    long = random_motion(np.random.default_rng(1), man(), 60, name="long")
    both = retarget(shape_with_markers("man", man()), long, project=project).project
    performance = sample_performance(both, "horse")
    assert performance.times[-1] >= long.duration
    assert (performance.times[-1] / clip.duration) % 1.0 == pytest.approx(0.0, abs=1e-6)
    assert sample_performance(both, "man").times[-1] == pytest.approx(long.duration, abs=1 / 30)
    assert sample_performance(loop_takes(both, "man"), "man").times[-1] == pytest.approx(
        long.duration, abs=1e-9
    )
