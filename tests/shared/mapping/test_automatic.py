"""Tests of retargeting invariants: identity on the same body, independence of the heading, no motion from a
performer at rest.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_bodies import horse, man, random_motion, rotate_clip, shape_with_markers, snake, spider

from enliven.document.clip import Clip
from enliven.document.project import Project
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.mapping.applying import apply_plan, source_anatomy
from enliven.mapping.automatic_mapping import create_automatic_plan, retarget
from enliven.mapping.plan import ChainPlan, Plan
from enliven.mapping.resting import (
    change_rest_pose,
    compute_first_heading,
    compute_hanging_pose,
    mean_pose,
    mean_turn,
    pose_at,
    pose_skeleton,
)
from enliven.mapping.softening import soften_plan
from enliven.motion.layers.evaluate import Player
from enliven.rotation import from_rotation_vector, multiply, normalized, rotate, swing

SEEDS = st.integers(0, 10_000)


def joints_of(clip, frame):
    """Returns (N, 3) a clip's joint positions, with its root at the rest position."""
    return pose_skeleton(clip.skeleton, clip.turns[frame]).positions


def made_joints(made, time):
    return Player(made.project, made.shape_id).sample(np.array([time]))[1][0]


@settings(max_examples=6, deadline=None)
@given(SEEDS)
def test_on_oneself_it_is_the_identity(seed):
    random = np.random.default_rng(seed)
    for skeleton in (man(), horse()):
        clip = random_motion(random, skeleton)
        heading = compute_first_heading(clip)
        shape = shape_with_markers("self", skeleton)
        result = retarget(shape, clip, replace(create_automatic_plan(clip, shape), floor=False))
        assert {chain.mode for chain in result.plan.chains} == {"pose"}
        back = heading * [1, -1, -1, -1]
        for frame in (0, 3, 7):
            expected = joints_of(clip, frame)
            # Whoever begins looking aside is turned to look ahead.
            expected = expected[0] + rotate(back, expected - expected[0])
            driven = [j for j, name in enumerate(skeleton.names) if "thumb" not in name and "ear" not in name]
            driven = [j for j in driven if skeleton.names[j] != "nose"]
            joints_now = made_joints(result, frame * clip.step)
            np.testing.assert_allclose(joints_now[driven], expected[driven], atol=1e-6)


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(SEEDS, st.floats(-3, 3))
def test_the_heading_of_the_performer_does_not_matter(seed, angle):
    random = np.random.default_rng(seed)
    clip = random_motion(random, man())
    for target in (man(), horse(), spider()):
        shape = shape_with_markers("target", target)
        first, second = retarget(shape, clip), retarget(shape, rotate_clip(clip, angle))
        for time in (0.0, 0.35, 0.7):
            np.testing.assert_allclose(made_joints(first, time), made_joints(second, time), atol=1e-6)


@settings(max_examples=4, deadline=None)
@given(SEEDS)
def test_who_stands_still_moves_nobody(seed):
    random = np.random.default_rng(seed)
    clip = random_motion(random, man(), frames=1)
    clip = replace(clip, turns=np.repeat(clip.turns, 4, 0), root=np.repeat(clip.root, 4, 0))
    for target in (horse(), spider(), snake()):
        result = retarget(shape_with_markers("target", target), clip)
        np.testing.assert_allclose(made_joints(result, 0.2), target.positions, atol=1e-9)


@settings(max_examples=5, deadline=None)
@given(SEEDS)
def test_travel_goes_where_the_performer_goes(seed):
    random = np.random.default_rng(seed)
    clip = random_motion(random, man())
    shape = shape_with_markers("self", man())
    plan = replace(create_automatic_plan(clip, shape), travel=True)
    result = retarget(shape, clip, plan)
    way = made_joints(result, 0.7)[0] - made_joints(result, 0.0)[0]
    back = compute_first_heading(clip) * [1, -1, -1, -1]
    np.testing.assert_allclose(way, rotate(back, clip.root[-1] - clip.root[0]), atol=1e-6)
    still = retarget(shape, clip)
    level = [0, 2]
    np.testing.assert_allclose(
        made_joints(still, 0.7)[0, level], made_joints(still, 0.0)[0, level], atol=1e-12
    )


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_another_rest_pose_changes_nothing_of_where_joints_are(seed):
    random = np.random.default_rng(seed)
    clip = random_motion(random, horse(), size=1.0)
    for since in (
        mean_pose(clip),
        pose_at(clip, 0.3),
        normalized(random.normal(size=(len(horse()), 4))),
    ):
        other = change_rest_pose(clip, since)
        for frame in (0, 4):
            np.testing.assert_allclose(joints_of(other, frame), joints_of(clip, frame), atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(SEEDS)
def test_the_mean_of_turns_is_among_them_and_turns_with_them(seed):
    random = np.random.default_rng(seed)
    turns = from_rotation_vector(0.5 * random.normal(size=(9, 3))) * random.choice([-1, 1], (9, 1))
    q = normalized(random.normal(size=4))
    assert abs(mean_turn(multiply(q, turns)) @ multiply(q, mean_turn(turns))) == pytest.approx(1, abs=1e-9)
    same = np.tile(turns[0], (4, 1))
    assert abs(mean_turn(same) @ turns[0]) == pytest.approx(1, abs=1e-12)


def test_modes_follow_from_the_build():
    clip = random_motion(np.random.default_rng(1), man())

    def modes(target):
        return {chain.mode for chain in create_automatic_plan(clip, shape_with_markers("x", target)).chains}

    assert modes(man()) == {"pose"}
    assert modes(horse()) == modes(spider()) == modes(snake()) == {"move"}


def test_the_anatomy_of_a_take_that_rests_in_a_bad_pose():
    """Walkers whose file rests in mid-stride are recognised by their proportions."""
    clip = random_motion(np.random.default_rng(4), man())
    strange = change_rest_pose(clip, pose_at(clip, 0.3))
    assert len(source_anatomy(strange).pairs) == 2


def test_missing_joint_is_named_with_the_existing_ones():
    clip, shape = random_motion(np.random.default_rng(1), man()), shape_with_markers("h", horse())
    good = ChainPlan(("Left hip", "Left toe"), ("Left hip", "Left hind hoof"))
    apply_plan(Project(), shape, clip, Plan(chains=(good,)))
    with pytest.raises(InputError, match="the take has no joint 'Left hoof'") as caught:
        apply_plan(Project(), shape, clip, Plan(chains=(replace(good, source=("Left hip", "Left hoof")),)))
    assert "Left knee, " in caught.value.remedy and "Right toe" in caught.value.remedy
    with pytest.raises(InputError, match="the model has no joint 'wing'") as caught:
        apply_plan(Project(), shape, clip, Plan(chains=(replace(good, target=("wing",)),)))
    assert "Left hock" in caught.value.remedy
    with pytest.raises(InputError, match="leads towards the root"):
        up = replace(good, target=("Left hind hoof", "Left hip"))
        apply_plan(Project(), shape, clip, Plan(chains=(up,)))


def test_weight_offset_speed_and_extend_do_what_they_say():
    clip, shape = random_motion(np.random.default_rng(2), man()), shape_with_markers("h", horse())
    chain = ChainPlan(
        ("Left hip", "Left toe"), ("Left hip", "Left stifle"), weight=0.5, offset=0.2, speed=2.0
    )
    result = retarget(shape, clip, Plan(chains=(replace(chain, extend=True),)))
    layer = next(layer for layer in result.project.shape(result.shape_id).layers if layer.weight == 0.5)
    assert (layer.offset, layer.speed) == (0.2, 2.0)
    hoof = horse().index("Left hind hoof")
    moved = result.project.shape("h").spans[hoof][0].refs
    assert [(ref.layer, ref.end) for ref in moved] == [(layer.id, 1.0)]
    assert result.duration == pytest.approx(0.2 + clip.duration / 2)
    short = retarget(shape, clip, Plan(chains=(chain,)))
    assert short.project.shape("h").spans[hoof][0].refs == ()
    none = retarget(shape, clip, Plan(turn=False, chains=(replace(chain, weight=0.0),)))
    np.testing.assert_allclose(made_joints(none, 0.4), horse().positions, atol=1e-12)


def test_a_flip_turns_the_movement_half_round():
    clip, shape = random_motion(np.random.default_rng(2), man()), shape_with_markers("h", horse())
    chain = ChainPlan(("Left hip", "Left knee"), ("Left hip", "Left stifle"))
    plain = retarget(shape, clip, Plan(turn=False, chains=(chain,)))
    flipped = retarget(shape, clip, Plan(turn=False, chains=(replace(chain, flip=True),)))
    bone = horse().index("Left stifle")
    a, b = (Player(m.project, "h").sample([0.7])[0][0, bone] for m in (plain, flipped))
    along = horse().vectors[bone] / np.linalg.norm(horse().vectors[bone])
    half = np.concatenate([[0.0], along])
    expected = multiply(multiply(half, a), half * [1, -1, -1, -1])
    assert abs(expected @ b) == pytest.approx(1, abs=1e-9)


def test_nothing_to_drive_is_an_error():
    clip, shape = random_motion(np.random.default_rng(2), man()), shape_with_markers("h", horse())
    with pytest.raises(InputError, match="no chain of the take matches"):
        retarget(shape, clip, Plan())


@settings(max_examples=8, deadline=None)
@given(SEEDS)
def test_one_leg_poses_two(seed):
    """Of the performer's one thigh two are to be alike: the take rests in two ways, and both are."""
    clip = random_motion(np.random.default_rng(seed), man())
    chain = ChainPlan(("hips", "Left knee"), ("Left hip", "Left stifle"), mode="pose")
    other = replace(chain, target=("Right hip", "Right stifle"))
    moved = replace(chain, target=("dock", "tail"), mode="move")
    trunk = ChainPlan(("hips",), ("croup",), mode="pose")
    result = retarget(
        shape_with_markers("h", horse()), clip, Plan(floor=False, chains=(trunk, chain, other, moved))
    )
    assert len(result.project.takes) == 3
    back = compute_first_heading(clip) * [1, -1, -1, -1]
    knee, hip = man().index("Left knee"), man().index("Left hip")
    for frame in (0, 5):
        at = joints_of(clip, frame)
        thigh = rotate(back, at[knee] - at[hip])
        joints_now = made_joints(result, frame * clip.step)
        for side in ("Left", "Right"):
            bone = joints_now[horse().index(f"{side} stifle")] - joints_now[horse().index(f"{side} hip")]
            assert bone @ thigh == pytest.approx(np.linalg.norm(bone) * np.linalg.norm(thigh), rel=1e-6)


def test_hanging_pose_of_a_waving_performer_has_hanging_arms():
    """Arms are up in seven of ten frames. The mean pose raises them, but the calm pose lets them hang."""
    skeleton = man()
    arm = [skeleton.index(name) for name in ("Left shoulder", "Left elbow", "Left wrist")]
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (100, len(skeleton), 1))
    for bone in arm[1:]:
        along = skeleton.vectors[bone] / skeleton.lengths[bone]
        turns[:, bone] = swing(along, np.array([0.0, -1.0, 0.0]))
        turns[15:85, bone] = swing(along, np.array([0.6, 0.8, 0.0]))
    clip = Clip("wave", skeleton, turns, np.zeros((100, 3)), 1 / 30)

    def rise(since):
        return rotate(since[arm[1]], skeleton.vectors[arm[1]])[1] / skeleton.lengths[arm[1]]

    assert rise(compute_hanging_pose(clip, [arm])) == pytest.approx(-1.0)
    assert rise(mean_pose(clip)) > 0.0


def mirrored(names):
    return tuple(name.replace("Left", "*").replace("Right", "Left").replace("*", "Right") for name in names)


@settings(max_examples=10, deadline=None)
@given(SEEDS)
def test_a_map_is_symmetric_where_both_bodies_are_nearly(seed):
    """Hand-made models are a little off: what is cut and where must not depend on it."""
    random = np.random.default_rng(seed)
    off = 0.004 * random.normal(size=man().positions.shape)
    clip = random_motion(random, replace(man(), positions=man().positions + off))
    for body in (man(), horse(), spider()):
        off = 0.004 * random.normal(size=body.positions.shape)
        shape = shape_with_markers("x", replace(body, positions=body.positions + off))
        chains = create_automatic_plan(clip, shape).chains
        left = {(c.source, c.target, c.mode) for c in chains if c.role.startswith("left")}
        right = {
            (mirrored(c.source), mirrored(c.target), c.mode) for c in chains if c.role.startswith("right")
        }
        assert left == right and left


def test_an_elbow_that_is_a_little_off_is_cut_on_both_sides_or_on_neither():
    """One elbow is close enough to the performer's to count as equal; the other is slightly too far."""
    crooked = man().positions.copy()
    crooked[man().index("Left elbow"), 0] = 0.18 + 0.59 * 0.7
    crooked[man().index("Right elbow"), 0] = -0.18 - 0.625 * 0.7
    clip, body = random_motion(np.random.default_rng(0), man()), replace(man(), positions=crooked)
    chains = create_automatic_plan(clip, shape_with_markers("x", body)).chains
    arms = {side: [c.target for c in chains if c.role == f"{side} arm"] for side in ("left", "right")}
    assert [mirrored(target) for target in arms["left"]] == arms["right"]
    assert ("Left shoulder", "Left elbow") in arms["left"]


def test_a_spine_is_posed_as_one_and_a_foot_stays_flat():
    """The model's own hunch and flat feet are kept while its performer, whose foot bones slope, stands at
    rest.
    """
    hunched = man().positions.copy()
    hunched[man().index("spine"), 2] -= 0.08
    for side in ("Left", "Right"):
        hunched[man().index(f"{side} toe"), 1] = hunched[man().index(f"{side} ankle"), 1]
    shape = shape_with_markers("hunched", replace(man(), positions=hunched))
    clip = random_motion(np.random.default_rng(0), man(), frames=3, size=0.0)
    joints = made_joints(retarget(shape, clip), 0.1)
    names = ["hips", "spine", "chest", "Left ankle", "Left toe", "Right ankle", "Right toe"]
    for first, second in pairwise(names):
        if "ankle" not in second:
            a, b = man().index(first), man().index(second)
            np.testing.assert_allclose(joints[b] - joints[a], hunched[b] - hunched[a], atol=0.01)


def test_stretches_of_a_take_go_on_to_another_body_where_that_is_asked_for():
    """The left forearm becomes 1.5 times as long. The model is twice as large and has other names."""
    random = np.random.default_rng(4)
    clip = random_motion(random, man())
    elbow, wrist = (man().index(f"Left {name}") for name in ("elbow", "wrist"))
    strains = np.zeros((len(clip.turns), len(man()), 6))
    # In the rest pose, the forearm points along x.
    strains[:, wrist, 0] = np.log(1.5)
    clip = replace(clip, strains=strains)
    shape = shape_with_markers("giant", Skeleton(man(False).names, man().parents, 2.0 * man().positions))
    rest = np.linalg.norm(shape.skeleton.positions[wrist] - shape.skeleton.positions[elbow])
    lengths = []
    for stretch in (False, True):
        result = retarget(
            shape, clip, replace(create_automatic_plan(clip, shape), stretch=stretch, floor=False)
        )
        joints = Player(result.project, "giant").compute_pose(0.3).joints
        lengths.append(np.linalg.norm(joints[wrist] - joints[elbow]) / rest)
    assert lengths == pytest.approx([1.0, 1.5], abs=0.02)
    assert soften_plan(replace(create_automatic_plan(clip, shape), stretch=True), clip, shape).stretch
