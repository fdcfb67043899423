"""Tests of mapping people to people: limbs point in the same direction, extra joints stay rigid, planted feet
stand still.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from made_bodies import horse, man, random_motion, shape_with_markers, walk
from made_people import CONVENTIONS, convention_name, person

from enliven.document.clip import Clip
from enliven.document.skeleton import Skeleton
from enliven.mapping.applying import initial_facings
from enliven.mapping.automatic_mapping import create_automatic_plan, list_idle_limbs, retarget
from enliven.mapping.pose_error import limb_errors
from enliven.mapping.quality import MAX_POSE_DEGREES, measure_quality
from enliven.motion.layers.evaluate import Player
from enliven.rotation import from_rotation_vector, multiply, rotate, unit
from enliven.skeletons.anatomy import find_anatomy
from enliven.skeletons.facing import rotate_about_y

FAST = [Phase.explicit, Phase.generate]
"""Hypothesis phases without shrinking, which takes minutes for motions."""
SEEDS = st.integers(0, 10_000)
NAMES = st.sampled_from(sorted(CONVENTIONS))
SEGMENTS = [(side, *pair) for side in ("Left", "Right") for pair in (
    ("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"),
)]  # fmt: skip


def angles_by_hand(made, convention, clip, source_convention):
    """Returns (F, 8) degrees between corresponding limb segments of both people, in one facing. A slow
    reference, joint by joint.
    """
    frames = np.arange(len(clip.turns))
    joints = Player(made.project, made.shape_id).sample(frames * clip.step)[1]
    skeleton, theirs = made.project.shape(made.shape_id).skeleton, clip.skeleton
    turn = made.model_facing - made.take_facing
    angles = []
    for side, start, end in SEGMENTS:
        a, b = (skeleton.index(convention_name(convention, f"{side} {joint}")) for joint in (start, end))
        j = theirs.index(convention_name(source_convention, f"{side} {end}"))
        ours = joints[:, b] - joints[:, a]
        bones = [theirs.vectors[j] for _ in frames]
        wanted = np.array([_turned(q, v) for q, v in zip(clip.turns[:, j], bones, strict=True)])
        wanted = rotate_about_y(wanted, turn)
        cosine = np.sum(ours * wanted, 1) / np.linalg.norm(ours, axis=1) / np.linalg.norm(wanted, axis=1)
        angles.append(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    return np.array(angles).T


def _turned(q, v):
    w, u = q[0], q[1:]
    return v + 2 * np.cross(u, np.cross(u, v) + w * v)


@settings(max_examples=25, deadline=None, phases=FAST)
@given(SEEDS, NAMES, NAMES)
@pytest.mark.slow
def test_limbs_point_as_the_performers(seed, source, target):
    random = np.random.default_rng(seed)
    clip = random_motion(random, person(source, random), size=0.7)
    skeleton = person(target, random, extras=bool(seed % 2))
    result = retarget(shape_with_markers("model", skeleton), clip)
    assert angles_by_hand(result, target, clip, source).max() < 0.01
    errors = limb_errors(result.project, "model", clip, result.plan, result.duration)
    assert len(errors) == 8 and max(error.p90 for error in errors) < 0.01


@settings(max_examples=20, deadline=None, phases=FAST)
@given(SEEDS, st.booleans())
def test_arms_without_names_point_as_the_performers_at_any_proportions(seed, clawed):
    """Also if the rig has no wrists, since its fingers begin at the elbows."""
    random = np.random.default_rng(seed)
    performer = person("mixamo", random)
    names, parents, at = list(performer.names), performer.parents.tolist(), list(performer.positions)
    for side in ("Left", "Right"):
        finger = performer.index(f"mixamorig:{side}HandMiddle1")
        names.append(f"mixamorig:{side}HandMiddle2")
        parents.append(finger)
        at.append(at[finger] + 0.4 * performer.vectors[finger])
    performer = Skeleton(tuple(names), np.array(parents), np.array(at))
    clip = random_motion(random, performer, size=0.5)
    skeleton, wrists = nameless_man(random, clawed)
    result = retarget(shape_with_markers("model", skeleton), clip)
    joints = Player(result.project, "model").sample(np.arange(len(clip.turns)) * clip.step)[1]
    for side, (shoulder, elbow, wrist) in wrists.items():
        for start, end, name in ((shoulder, elbow, "elbow"), (elbow, wrist, "wrist")):
            bone = performer.index(convention_name("mixamo", f"{side} {name}"))
            wanted = rotate(clip.turns[:, bone], performer.vectors[bone])
            wanted = rotate_about_y(wanted, result.model_facing - result.take_facing)
            ours = joints[:, end] - joints[:, start]
            cosine = np.sum(unit(ours) * unit(wanted), axis=1)
            assert np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).max() < 0.01


def nameless_man(random, clawed):
    """Returns a man without names and with arms of random proportions, and (shoulder, elbow, wrist) by side.

    If ``clawed``, three fingers begin at each elbow, and the first finger's first joint is the wrist.
    """
    plain = man()
    factors = {name: random.uniform(0.7, 1.4) for name in ("elbow", "wrist", "finger")}
    names, parents, at = list[str](), list[int](), list[np.ndarray]()

    def add(name, parent, place):
        names.append(name)
        parents.append(-1 if parent is None else names.index(parent))
        at.append(place)

    for j, name in enumerate(plain.names):
        side, _, joint = name.rpartition(" ")
        parent = plain.names[plain.parents[j]] if j else None
        if clawed and joint in ("finger", "thumb"):
            continue
        vector = plain.vectors[j] * factors.get(joint, 1.0)
        if not clawed or joint != "wrist":
            add(name, parent, at[names.index(parent)] + vector if j else plain.positions[0])
            continue
        tip = plain.vectors[plain.index(f"{side} finger")] * factors["finger"]
        for number, aside in enumerate(([0.0, 0.0, 0.02], [0.0, 0.02, 0.0], [0.0, -0.02, 0.0])):
            claw = f"{side} wrist" if number == 0 else f"{side} claw {number}"
            add(claw, parent, at[names.index(parent)] + vector + aside)
            add(f"{claw} tip", claw, at[-1] + tip)
    arms = {
        side: [names.index(f"{side} {joint}") for joint in ("shoulder", "elbow", "wrist")]
        for side in ("Left", "Right")
    }
    return Skeleton(tuple(f"joint {j}" for j in range(len(names))), np.array(parents), np.array(at)), arms


@settings(max_examples=10, deadline=None, phases=FAST)
@given(SEEDS)
def test_the_measure_is_that_of_every_joint(seed):
    """Of a mapping that moves limbs less, so that there is something to measure."""
    random = np.random.default_rng(seed)
    clip = random_motion(random, person("mixamo", random), frames=40, size=0.7)
    shape = shape_with_markers("model", person("unreal", random))
    plan = create_automatic_plan(clip, shape)
    plan = replace(plan, chains=tuple(replace(chain, weight=0.7) for chain in plan.chains))
    result = retarget(shape, clip, plan)
    by_hand = angles_by_hand(result, "unreal", clip, "mixamo")
    errors = limb_errors(result.project, "model", clip, plan, result.duration)
    order = [
        f"{side.lower()} {name}"
        for side in ("Left", "Right")
        for name in ("upper arm", "forearm", "thigh", "shin")
    ]
    for error, column in zip(
        sorted(errors, key=lambda error: order.index(error.limb)), by_hand.T, strict=True
    ):
        assert error.median == pytest.approx(np.median(column), abs=1e-3), error.limb
        assert error.median > 0.1


@settings(max_examples=10, deadline=None, phases=FAST)
@given(SEEDS, NAMES, st.booleans())
def test_extras_are_rigid_with_their_joint(seed, convention, pin):
    """Also while feet are planted, which bends the legs."""
    random = np.random.default_rng(seed)
    clip = walk() if pin else random_motion(random, person("vrm", random), size=0.7)
    skeleton = person(convention, random, extras=True)
    shape = shape_with_markers("model", skeleton)
    result = retarget(shape, clip, replace(create_automatic_plan(clip, shape), travel=pin, pin=pin))
    turns = Player(result.project, "model").sample(np.arange(8) * clip.step)[0]
    for extra, beside in (
        ("Weapon", "Right finger"),
        ("Pinky1", "Left finger"),
        ("lowerarm_twist_01_l", "Left wrist"),
        ("thigh_twist_01_l", "Left knee"),
        ("Hair.002", "top"),
    ):
        a, b = turns[:, skeleton.index(extra)], turns[:, skeleton.index(convention_name(convention, beside))]
        np.testing.assert_allclose(np.abs(np.sum(a * b, 1)), 1.0, atol=1e-9, err_msg=extra)


def test_fingers_of_a_take_move_the_models_fingers():
    def with_fingers(convention, names):
        skeleton = person(convention)
        count, wrist = len(skeleton), skeleton.index(convention_name(convention, "Left wrist"))
        parents = [*skeleton.parents, wrist, count, count + 1]
        ends = skeleton.positions[wrist] + np.array([[0.08, 0, 0.03], [0.12, 0, 0.03], [0.15, 0, 0.03]])
        return replace(
            skeleton,
            names=(*skeleton.names, *names),
            parents=np.array(parents),
            positions=np.concatenate([skeleton.positions, ends]),
        )

    source = with_fingers("mixamo", ("LeftHandIndex1", "LeftHandIndex2", "LeftHandIndex3"))
    target = with_fingers("vrm", ("leftIndexProximal", "leftIndexIntermediate", "leftIndexDistal"))
    clip = random_motion(np.random.default_rng(0), source)
    still = Clip("still", source, clip.turns.copy(), clip.root, clip.step)
    bent = clip.turns.copy()
    for joint in ("LeftHandIndex2", "LeftHandIndex3"):
        bent[:, source.index(joint)] = multiply(
            clip.turns[:, source.index("LeftHandIndex1")],
            from_rotation_vector(np.linspace(0, 1.2, len(bent))[:, None] * [0.0, 1.0, 0.0]),
        )
    for joint in ("LeftHandIndex2", "LeftHandIndex3"):
        still.turns.setflags(write=True)
        still.turns[:, source.index(joint)] = still.turns[:, source.index("LeftHandIndex1")]
    shape = shape_with_markers("model", target)
    moving = create_automatic_plan(replace(clip, turns=bent), shape)
    assert "left index" in {chain.role for chain in moving.chains}
    assert "left index" not in {chain.role for chain in create_automatic_plan(still, shape).chains}
    result = retarget(shape, replace(clip, turns=bent), moving)
    turns = Player(result.project, "model").sample(np.array([0.0, result.duration]))[0]
    bone = target.index("leftIndexIntermediate"), target.index("leftIndexProximal")
    bend = [2 * np.arccos(min(abs(float(t[bone[0]] @ t[bone[1]])), 1.0)) for t in turns]
    assert bend[1] - bend[0] > 0.8


def test_nothing_is_softened_unless_asked():
    clip = random_motion(np.random.default_rng(2), man(), size=1.2)
    result = retarget(shape_with_markers("horse", horse()), clip)
    assert {chain.weight for chain in result.plan.chains if "whole" not in chain.role} == {1.0}


def test_an_arm_that_drives_nothing_is_named():
    clip, shape = walk(), shape_with_markers("man", man())
    plan = create_automatic_plan(clip, shape)
    assert list_idle_limbs(clip, plan) == ()
    kept = tuple(chain for chain in plan.chains if not chain.role.startswith("left arm"))
    assert list_idle_limbs(clip, replace(plan, chains=kept)) == ("left arm",)


def test_pose_is_the_first_figure_and_says_which_limbs():
    clip, shape = walk(raised=1.0), shape_with_markers("man", man())
    plan = create_automatic_plan(clip, shape)
    result = retarget(shape, clip, plan)
    good = measure_quality(result.project, "man", clip, result.duration, plan)
    assert str(good).startswith("every limb points within 0\u00b0") and not good.worst_limbs
    chains = tuple(replace(c, weight=0.3) if c.role == "left arm" else c for c in plan.chains)
    plan = replace(plan, chains=chains)
    result = retarget(shape, clip, plan)
    bad = measure_quality(result.project, "man", clip, result.duration, plan)
    assert {limb.limb for limb in bad.worst_limbs} == {"left upper arm", "left forearm"}
    assert bad.worst_limbs[0].median > MAX_POSE_DEGREES and bad.total_excess > good.total_excess


@settings(max_examples=8, deadline=None, phases=FAST)
@given(SEEDS, NAMES, st.floats(0.2, 0.4))
def test_planted_feet_stand_still_at_any_proportions(seed, convention, stride):
    """With --travel --pin: while a toe of the performer stands, the toe of the model does not move."""
    random = np.random.default_rng(seed)
    clip = walk(stride)
    skeleton = person(convention, random)
    shape = shape_with_markers("model", skeleton)
    plan = replace(create_automatic_plan(clip, shape), travel=True, pin=True)
    result = retarget(shape, clip, plan)
    times = np.arange(0.0, result.duration, 1 / 60)
    joints = Player(result.project, "model").sample(times)[1]
    legs = [limb for pair in find_anatomy(skeleton).legs for limb in pair]
    toes = joints[:, [limb.chain[-1] for limb in legs]]
    speed = np.linalg.norm(np.diff(toes[..., [0, 2]], axis=0), axis=2) * 60
    length = float(skeleton.lengths[list(legs[0].main[1:])].sum())
    # At any moment one of the two stands: its speed is below 2 cm/s on a leg of 1 m, the bound that is asked.
    assert np.percentile(speed.min(1), 90) < 0.02 * length
    travelled = np.linalg.norm(joints[-1, 0] - joints[0, 0])
    assert travelled > 2.0 * stride * length
    for limb in legs:
        at = joints[:, list(limb.main)]
        lengths = np.linalg.norm(np.diff(at, axis=1), axis=2)
        np.testing.assert_allclose(lengths, np.tile(lengths[0], (len(at), 1)), rtol=1e-6)


def test_facings_do_not_depend_on_the_convention():
    clip = walk()
    for convention in CONVENTIONS:
        shape = shape_with_markers("model", person(convention))
        assert initial_facings(clip, shape, create_automatic_plan(clip, shape)) == pytest.approx(
            (0.0, 0.0), abs=1e-6
        )
