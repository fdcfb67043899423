"""Tests that a mesh stays near its performer's path, scaled, whether it steps, stands on a base or swims."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from puppet_worlds import STEP, places_for, puppet_project, walker
from tolerances import assert_alike

from enliven.document.locomotion import LocomotionSettings
from enliven.examples.performer import extract_performer_clip
from enliven.examples.puppet_motion import evaluate_state, solve_layer_motion
from enliven.examples.spacetime.following import PathFollower
from enliven.examples.travel import find_alternating_feet, find_travel
from enliven.modeling.puppet.edits import play_take
from enliven.modeling.puppet.points import change_point
from enliven.modeling.puppet.poses import change_key_pose
from enliven.rotation import from_rotation_vector, multiply, rotate

few = settings(max_examples=6, deadline=None)
LEASH = LocomotionSettings().leash


def performance(seed, kind, seconds):
    """Returns a clip of a person that stays in place, walks, or turns, with random motion of hands and
    feet."""
    rng = np.random.default_rng(seed)
    clip = walker(seconds, turning=0.4 if kind == "walks" else 0.0, swing=0.45 if kind == "walks" else 0.2)
    if kind == "walks":
        return clip
    t = np.arange(len(clip.turns)) * STEP
    root = clip.root * [0.0, 1.0, 0.0]
    for _ in range(4):
        sway = np.sin(rng.uniform(0.2, 2.0) * t + rng.uniform(0, 6))
        root = root + 0.1 * (sway - sway[0])[:, None] * [*rng.normal(size=1), 0.0, *rng.normal(size=1)]
    turns = clip.turns
    if kind == "turns":
        angle = np.cumsum(rng.uniform(-1, 1) + 0 * t) * STEP
        turn = from_rotation_vector(angle[:, None] * [0.0, 1.0, 0.0])
        turns = multiply(turn[:, None], turns)
    return replace(clip, turns=turns, root=root)


def project_of(seed, kind, body, seconds):
    """Returns a stool that steps, or has feet that are posed only together (a base), or has no feet (it
    swims).
    """
    project = puppet_project(seed, clip=performance(seed, kind, seconds))
    puppet, clip = project.puppets["stool"], project.takes["walk"]
    seen = extract_performer_clip(clip, ["LeftFoot", "RightFoot"]).poses
    for number, pose in enumerate(puppet.poses):
        at = pose.places.copy()
        at[:2] = puppet.rest[:2]
        if body == "steps":
            at[:2] += 0.8 * (seen[round(pose.time / STEP)] - seen.mean(0))
            at[:2, 1] = np.maximum(at[:2, 1], 0.0)
        project = change_key_pose(project, "stool", number, places=at)
    if body == "swims":
        for name in ("left foot", "right foot"):
            project = change_point(project, "stool", name, foot=False)
    return project


def loose(project):
    """Returns the project and its stool without a leash, so that it goes where its own steps lead."""
    puppet = project.puppets["stool"]
    puppet = replace(puppet, locomotion=replace(puppet.locomotion, leash=1000.0))
    return project.with_characters(puppet), puppet


@given(
    st.integers(0, 10**6),
    st.sampled_from(["stays", "walks", "turns"]),
    st.sampled_from(["steps", "stands", "swims"]),
)
@example(2921, "turns", "steps")
@settings(max_examples=15, deadline=None)
@pytest.mark.slow
def test_nobody_is_led_astray_in_a_minute(seed, kind, body):
    project = project_of(seed, kind, body, 60)
    puppet = project.puppets["stool"]
    assert bool(find_travel(project, puppet).feet) == (body == "steps")
    walk = solve_layer_motion(project, puppet, 0)
    assert walk.travels
    size = float(np.linalg.norm(np.ptp(puppet.rest, axis=0)))
    off = np.linalg.norm((walk.root - walk.root[0] - walk.path)[:, [0, 2]], axis=1)
    if body == "steps":
        # Its own steps lead it away at any speed, but never farther than two leashes.
        assert off.max() < 2 * LEASH * size + 1e-6
    else:
        own = solve_layer_motion(*loose(project), 0)
        away = np.linalg.norm(np.diff(own.root - own.path, axis=0)[:, [0, 2]], axis=1).max() / STEP
        assert off.max() < LEASH * size + 0.02 * away + 0.01
    assert off[-1] < 0.2


@given(st.integers(0, 10**6), st.sampled_from(["steps", "stands", "swims"]), st.floats(-3, 3))
# Two feet had equal heights, so rounding chose between them.
@example(447450, "steps", 0.0)
@few
def test_the_path_is_the_performers_in_its_strides_and_from_its_own_front(seed, body, angle):
    project = project_of(seed, "turns", body, 4)
    clip = project.takes["walk"]
    turn = from_rotation_vector(np.array([0.0, angle, 0.0]))
    moved = replace(
        clip, turns=multiply(turn, clip.turns), root=rotate(turn, clip.root) + np.array([3.0, 0.0, 1.0])
    )
    turned_project = project.with_takes(moved)
    paths = [solve_layer_motion(each, each.puppets["stool"], 0).path for each in (project, turned_project)]
    np.testing.assert_allclose(paths[0], paths[1], atol=1e-7)
    stride = find_travel(project, project.puppets["stool"]).stride
    far = np.linalg.norm((clip.root - clip.root[0])[:, [0, 2]], axis=1)
    np.testing.assert_allclose(np.linalg.norm(paths[0], axis=1), abs(stride) * far, atol=1e-9)


def test_a_walker_goes_as_far_as_its_own_steps_and_another_size_counts_where_nobody_walks():
    walks = project_of(3, "walks", "steps", 6)
    travel = find_travel(walks, walks.puppets["stool"])
    assert set(travel.feet) == {0, 1}
    own = solve_layer_motion(*loose(walks), 0)
    far = [
        np.linalg.norm(np.diff(way[::30], axis=0)[:, [0, 2]], axis=1).sum() for way in (own.root, own.path)
    ]
    assert far[0] == pytest.approx(far[1], rel=0.15)
    stays = project_of(3, "stays", "swims", 6)
    # The stool is 1 m tall and wide. The performer is 1.75 m tall, with an arm span of 1.4 m.
    assert find_travel(stays, stays.puppets["stool"]).stride == pytest.approx(1.0 / 1.75)


@given(st.integers(0, 10**6), st.floats(-3, 3))
@few
def test_drift_correction_does_not_slide_planted_feet(seed, angle):
    """Its performer is carried aside by 6 cm a second, which its steps know nothing of."""
    walks = project_of(seed, "walks", "steps", 8)
    clip, (_, free) = walks.takes["walk"], loose(walks)
    drift = 0.06 * np.arange(len(clip.root))[:, None] * STEP * [np.cos(angle), 0.0, np.sin(angle)]
    carried = replace(clip, id="carried", root=clip.root + drift)
    project = play_take(walks.with_takes(carried), "stool", "carried", level_feet=False)
    corrected, plain = (
        solve_layer_motion(project, project.puppets["stool"], 1),
        solve_layer_motion(walks, free, 0),
    )
    drawn = np.linalg.norm((corrected.root - plain.root)[-1, [0, 2]])
    assert drawn > 0.1
    moves = {"drawn": corrected, "loose": plain}
    for name, motion in moves.items():
        still = np.flatnonzero((motion.anchors[1:] == motion.anchors[:-1]) & (motion.anchors[1:] >= 0))
        spots = [
            [motion.compute_world_position(f, int(motion.anchors[k + 1])) for f in (k, k + 1)] for k in still
        ]
        moves[name] = np.linalg.norm(np.diff(spots, axis=1)[:, 0, [0, 2]], axis=1)
    assert moves["loose"].max() < 1e-9
    assert np.mean(moves["drawn"] < 1e-9) > 0.95
    # At the end of the take the feet return to their positions, so that it can loop. They do not slide then.
    assert (moves["drawn"][-5:] < 1e-9).all()
    own = solve_layer_motion(*loose(project), 1)
    np.testing.assert_allclose(corrected.places[-1], own.places[-1], atol=1e-9)


@given(st.integers(0, 10**6), st.integers(2, 40))
@few
def test_drift_does_not_grow_with_loops(seed, rounds):
    project = project_of(seed, "stays", "steps", 5)
    walk = solve_layer_motion(project, project.puppets["stool"], 0)
    turn, offset = float(walk.yaw[-1]), walk.path[-1]
    assert turn == pytest.approx(0.0, abs=1e-9)
    for frame in (0.0, 40.3, walk.frames - 1.0):
        once, often = (walk.root_at(frame, n)[1] - n * offset for n in (1, rounds))
        np.testing.assert_allclose(often, once, atol=1e-9)


def test_feet_alternate_that_go_to_and_fro_or_up_and_down_on_the_ground():
    rest = places_for(np.array([[0.1, 0, 0], [-0.1, 0, 0], [0, 1.0, 0]], float), 0, 0.0)
    poses = np.repeat(rest[None], 3, axis=0)
    assert find_alternating_feet(poses, [0, 1]) == ()
    poses[1, 0, 1] = poses[2, 1, 1] = 0.2
    assert find_alternating_feet(poses, [0, 1]) == (0, 1)
    assert find_alternating_feet(poses, [0]) == () == find_alternating_feet(poses, [])
    swept = np.repeat(rest[None], 2, axis=0)
    swept[1, :2, 2] = 0.2, -0.2
    assert find_alternating_feet(swept, [0, 1]) == (0, 1)
    together = np.repeat(rest[None], 2, axis=0)
    together[1, :2, 2] = 0.4
    assert find_alternating_feet(together, [0, 1]) == ()
    fin = np.repeat(rest[None], 2, axis=0)
    fin[:, 1, 1], fin[1, 1, 1] = 0.3, 0.6
    assert find_alternating_feet(fin, [0, 1]) == (), "what never touches the ground does not step"


@given(st.floats(0.05, 0.5), st.floats(-3, 3), st.floats(1 / 120, 1 / 20))
@few
def test_drift_correction_acts_only_beyond_leash_at_any_rate(far, angle, step):
    how = LocomotionSettings(leash=0.1)
    off = far * np.exp(1j * angle)
    follows = PathFollower(1.0, how, step, 2)
    pull = 0j
    for _ in range(round(1.0 / step)):
        pull += follows.compute_correction(off - pull, [True, False])
        assert abs(follows.held[0]) <= 0.15 + 1e-12 and follows.held[1] == 0j
    if far <= 0.1:
        assert pull == 0j
    elif far < 0.2:
        seconds = round(1.0 / step) * step
        assert follows.held[0] == pytest.approx(-pull)
        assert abs(off - pull) == pytest.approx(0.1 + (far - 0.1) * np.exp(-2.0 * seconds), rel=1e-6)
    else:
        assert abs(off - pull) < 0.21
    for _ in range(round(1.0 / step)):
        follows.compute_correction(0j, [False, False])
    assert abs(follows.held[0]) < 1e-3, "a lifted foot goes back to its place"


@given(st.integers(0, 10**6), st.floats(0.1, 6.0), st.floats(1 / 120, 1 / 20))
@settings(max_examples=20, deadline=None)
def test_no_step_leads_the_mesh_farther_than_two_leashes(seed, speed, step):
    """Its feet stand, are lifted and carry it away in random directions. Its performer moves, too."""
    rng = np.random.default_rng(seed)
    follows = PathFollower(1.0, LocomotionSettings(leash=0.1), step, 2)
    frames = round(4.0 / step)
    phases = (np.arange(frames) * step / 0.5).astype(int)
    own, path = (most * np.exp(2j * np.pi * rng.random(phases[-1] + 1)) for most in (speed, min(speed, 3.0)))
    stances = rng.random((phases[-1] + 1, 2)) < 0.5
    off = follows.compute_correction(0j, [False, False])
    for phase in phases:
        moved = own[phase] * step
        off += path[phase] * step - moved
        pull = follows.compute_correction(off, stances[phase].tolist(), moved)
        off -= pull
        assert abs(off) < 0.2 + 1e-9
    # The path jumps by three sizes. The mesh follows with a time constant of 0.2 s, and does not jump.
    pull = follows.compute_correction(off + 3.0, [True, False], 0j)
    assert 10 * step < abs(pull) < 20 * step


@given(st.floats(0.0, 0.33), st.floats(-3, 3), st.floats(1 / 120, 1 / 20))
@few
def test_standing_foot_returns_to_its_position_when_the_drift_reverses(far, angle, step):
    """The mesh drifts to one side and back within a second, while its foot stands."""
    follows = PathFollower(1.0, LocomotionSettings(leash=0.1), step, 1)
    frames = max(round(0.5 / step), 1)
    move = far * np.exp(1j * angle) / frames
    off = 0j
    for moved in [move] * frames + [-move] * frames:
        off -= moved
        pull = follows.compute_correction(off, [True], moved)
        off -= pull
        # The foot stays in place: all of the pull displaces it in the mesh.
        assert abs(off - follows.held[0]) <= far + 1e-9
    assert abs(off - follows.held[0]) < 1e-9
    # Only the slow pull remains.
    assert abs(follows.held[0]) < 0.06


def test_puppet_without_travel_stays_in_place():
    project = puppet_project(0, travel=False)
    now = evaluate_state(project, project.puppets["stool"], 1.3)
    assert_alike(now.root, np.zeros(3))
