"""Tests of planted feet: contacts are found at any pace, feet stand still, and legs keep their pose."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from made_bodies import man, shape_with_markers, walk
from made_gaits import HEEL, STEP, TOE, gait, shod, sway

from enliven.document.clip import Clip, joint_places
from enliven.document.skeleton import Skeleton
from enliven.mapping.automatic_mapping import create_automatic_plan, retarget
from enliven.mapping.ground import compute_posed_surfaces, floor_height_under
from enliven.mapping.legs.planting import (
    PosedLeg,
    contact_clearance,
    find_standing_spans,
    hold_heading,
    plant_body,
    remove_spin,
)
from enliven.mapping.legs.sole import Sole, compute_rolling_motion
from enliven.mapping.quality import measure_quality
from enliven.motion.layers.evaluate import Player
from enliven.rotation import conjugate, from_rotation_vector, multiply, rotate, to_rotation_vector

SLIDE = 3.0
"""Maximum speed of standing feet in 90 % of the frames, cm/s."""
CLEAR = 0.01
"""Minimum height of a foot above the floor in the middle of its swing, metres."""


def steps_of(speed, stance_s, swing_s=0.35, rounds=4, seed=0):
    """Returns the foot (T, 3), the root (T, 3) that moves over it at a speed (m/s), and when the foot
    stands.
    """
    random = np.random.default_rng(seed)
    period = stance_s + swing_s
    times = np.arange(round(rounds * period / STEP)) * STEP
    number, into = np.divmod(times, period)
    share = np.clip((into - stance_s) / swing_s, 0.0, 1.0)
    eased = share * share * (3.0 - 2.0 * share)
    foot = np.zeros((len(times), 3))
    foot[:, 2] = (number + eased) * speed * period
    foot[:, 1] = 0.15 * np.sin(np.pi * share) + 0.03
    root = np.array([0.1, 0.9, 0.0]) + speed * times[:, None] * [0.0, 0.0, 1.0]
    return foot + random.normal(size=foot.shape) * 2e-4, root, share <= 0.0


@pytest.mark.parametrize(("speed", "stance"), [(0.8, 0.7), (1.4, 0.6), (3.0, 0.2), (5.0, 0.13), (7.0, 0.09)])
def test_contacts_of_walks_runs_and_sprints_are_found(speed, stance):
    foot, root, stands = steps_of(speed, stance)
    in_contact = np.zeros(len(foot), bool)
    for first, last in find_standing_spans(foot[:, None], root, STEP, 0.85):
        in_contact[first : last + 1] = True
    edges = np.convolve(np.abs(np.diff(stands.astype(int), prepend=0)), np.ones(7), "same") > 0
    assert (in_contact == stands)[~edges].all(), "but for three frames at the ends of each contact"
    assert in_contact.sum() > 0.9 * stands.sum()


def test_a_foot_that_is_lifted_on_the_spot_or_glides_does_not_stand():
    times = np.arange(120)[:, None] * STEP
    still = np.tile([0.0, 0.9, 0.0], (120, 1))
    lifted = np.clip(np.sin(2 * np.pi * times), 0.0, None) * [0.0, 0.4, 0.0]
    for first, last in find_standing_spans(lifted[:, None], still, STEP, 0.85):
        assert lifted[first : last + 1, 1].max() < 0.1
    glides = times * [0.0, 0.0, 3.0]
    assert find_standing_spans(glides[:, None], np.add(glides, [0.0, 0.9, 0.0]), STEP, 0.85) == ()


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 1000), speed=st.floats(0.5, 6.0), longer=st.floats(0.7, 1.4))
def test_the_foot_that_stands_is_still_and_on_the_floor(seed, speed, longer):
    """A body with a foot that goes farther or less far than its performer's beside the hips."""
    foot, root, _ = steps_of(speed, 0.3, seed=seed)
    spans = find_standing_spans(foot[:, None], root, STEP, 0.85)
    own = (foot - root) * [1.0, 1.0, longer]
    leg = PosedLeg(own[:, [0, 2]], own[:, 1] - 0.03, np.maximum(foot[:, 1] - 0.03, 0.0), 0.85, spans)
    way, (offset,) = plant_body([leg], root, STEP, 0.0)
    at = way + own + offset
    for first, last in spans:
        assert np.ptp(at[first : last + 1, [0, 2]], axis=0).max() < 1e-9
        np.testing.assert_allclose(at[first : last + 1, 1], 0.03, atol=1e-9)
    # Most of it is the way of the body, the rest is left to the leg; and nothing jerks.
    assert np.abs(offset[:, 2]).max() < 0.35 * abs(longer - 1.0) * speed * 0.3 + 0.02
    assert np.abs(np.diff(offset, 2, axis=0)).max() < 0.02


def test_without_contacts_the_body_goes_as_its_performer():
    _, root, _ = steps_of(1.0, 0.5)
    still = np.zeros_like(root)
    leg = PosedLeg(still[:, [0, 2]], still[:, 0], still[:, 0], 0.85, ())
    way, (offset,) = plant_body([leg], root, STEP, 0.0)
    np.testing.assert_array_equal(way, root)
    assert not offset.any()


def short_shinned(shin):
    """Returns a man with shins of a different length, standing on the floor."""
    skeleton = man()
    at = skeleton.positions.copy()
    for side in ("Left", "Right"):
        knee, ankle = (skeleton.index(f"{side} {name}") for name in ("knee", "ankle"))
        shift = (shin - 1.0) * (at[ankle] - at[knee])
        for j in range(len(skeleton)):
            if ankle in skeleton.path(0, j):
                at[j] += shift
    at[:, 1] -= at[:, 1].min()
    return Skeleton(skeleton.names, skeleton.parents, at)


@pytest.mark.parametrize("shin", [0.75, 1.3])
def test_legs_of_other_proportions_keep_their_pose_while_feet_are_planted(shin):
    shape, clip = shape_with_markers("man", short_shinned(shin)), walk(0.4)
    plan = replace(create_automatic_plan(clip, shape), travel=True, pin=True)
    result = retarget(shape, clip, plan)
    quality = measure_quality(result.project, "man", clip, result.duration, plan)
    legs = [limb for limb in quality.limbs if "thigh" in limb.limb or "shin" in limb.limb]
    assert legs and max(limb.median for limb in legs) < 4.0 and quality.slide < 3.0
    low = [
        at[:, 1].min()
        for at in compute_posed_surfaces(result.project, "man", np.linspace(0.0, result.duration, 20))
    ]
    assert min(low) > floor_height_under(shape) - 1e-3
    free = retarget(shape, clip, replace(plan, pin=False))
    ways = [
        Player(each.project, "man").compute_root(np.array([0.0, clip.duration])) for each in (result, free)
    ]
    assert np.linalg.norm(ways[0][1] - ways[0][0]) > 0.5 * np.linalg.norm(ways[1][1] - ways[1][0])


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 1000), radius=st.floats(0.02, 0.4))
def test_a_wheel_rolls_by_its_radius_times_its_angle(seed, radius):
    """The twin of a rolling foot: which point touches is known, and how far it goes."""
    angles = np.cumsum(np.random.default_rng(seed).uniform(-0.05, 0.05, 80))
    rim = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    around = rim + angles[:, None]
    points = radius * np.stack([0.0 * around, np.cos(around), np.sin(around)], axis=2)
    rolled, low = compute_rolling_motion(points, 1e-4 * radius)
    np.testing.assert_allclose(low, -radius, rtol=1e-3)
    # The lowest point of a wheel that turns towards +Z goes back.
    np.testing.assert_allclose(rolled[:, 1], -radius * (angles - angles[0]), atol=0.01 * radius)
    np.testing.assert_array_equal(rolled[:, 0], 0.0)


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 1000), few=st.integers(3, 10), more=st.floats(2.0, 4.0), toes_move=st.booleans())
def test_of_two_parts_that_touch_the_floor_the_larger_stands_still(seed, few, more, toes_move):
    """As of a boot with a hinged toe cap: with the mean of their motions, both parts would slide."""
    random = np.random.default_rng(seed)
    still = random.uniform(-0.1, 0.0, (round(more * few), 3)) * [1.0, 0.0, 1.0]
    moving = random.uniform(-0.1, 0.0, (few, 3)) * [1.0, 0.0, 1.0]
    (moving if toes_move else still)[:, 2] += 0.2
    way = np.cumsum(random.uniform(-0.004, 0.004, (40, 3)), axis=0) * [1.0, 0.0, 1.0]
    moved = moving + way[:, None]
    points = np.concatenate([np.tile(still, (40, 1, 1)), moved], axis=1)
    rolled = compute_rolling_motion(points, 0.005)[0]
    assert np.abs(np.diff(rolled, axis=0)).max() < 0.2 * np.abs(np.diff(way, axis=0)).max()
    np.testing.assert_allclose(compute_rolling_motion(moved, 0.005)[0], (way - way[0])[:, [0, 2]], atol=1e-12)


def with_toe_tips(skeleton, name):
    """Returns a skeleton with a joint at the tip of each toe, 7 cm ahead of the ball, and names like "joint
    3".

    Of a skeleton with the joint names of a person, the feet have no toes that move.
    """
    names, parents, at = list(skeleton.names), skeleton.parents.tolist(), list(skeleton.positions)
    for side in ("Left", "Right"):
        toe = names.index(f"{side} toe")
        names.append(f"{side} tip")
        parents.append(toe)
        at.append(at[toe] + [0.0, 0.0, 0.07])
    return Skeleton(tuple(f"{name} {j}" for j in range(len(at))), np.array(parents), np.array(at))


@pytest.mark.slow
@settings(deadline=None, max_examples=8, phases=[Phase.explicit, Phase.generate])
@given(seed=st.integers(0, 1000), tremor=st.floats(2.0, 8.0))
def test_toes_that_tremble_are_calm_in_a_planted_body_and_bend_if_the_performers_do(seed, tremor):
    random, performer = np.random.default_rng(seed), with_toe_tips(man(), "bone")
    shape = shape_with_markers("model", with_toe_tips(short_shinned(1.2), "joint"))
    tips = [len(performer) - 2, len(performer) - 1]
    slow = 15.0 * np.sin(2.0 * np.pi * np.arange(120) * STEP / 1.0)
    steps = []
    for noise in (0.0, tremor):
        turns = np.tile([1.0, 0.0, 0.0, 0.0], (120, len(performer), 1))
        angles = np.radians(slow[:, None] + noise * random.choice([-1.0, 1.0], (120, 2)))
        for tip, angle in zip(tips, angles.T, strict=True):
            turns[:, tip] = from_rotation_vector(-angle[:, None] * [1.0, 0.0, 0.0])
        clip = Clip("toes", performer, turns, np.tile(performer.positions[0], (120, 1)), STEP)
        plan = replace(create_automatic_plan(clip, shape), travel=True, pin=True)
        result = retarget(shape, clip, plan)
        moved = Player(result.project, "model").sample(np.arange(120) * STEP)[0]
        toes = [performer.parents[tip] for tip in tips]
        bends = to_rotation_vector(multiply(conjugate(moved[:, toes]), moved[:, tips]))[..., 0].T
        steps.append(np.degrees(bends))
    calm, trembling = steps
    assert np.ptp(calm, axis=1).min() > 25.0, "the slow bend of 30 degrees remains"
    assert np.abs(np.diff(trembling - calm, axis=1)).max() < 0.5 * 2.0 * tremor


@settings(deadline=None, max_examples=15)
@given(drift=st.floats(-0.2, 0.2), lift=st.floats(0.0, 0.3))
def test_a_foot_is_as_high_as_it_rose_since_it_stood_on_a_floor_that_drifts(drift, lift):
    times = np.arange(90) * STEP
    up = lift * np.clip(np.sin(2.0 * np.pi * times / 0.5), 0.0, None)
    spans = tuple((a, min(a + 15, 89)) for a in range(15, 90, 30))
    heights = (0.1 + drift * times + up)[:, None] + [0.0, 0.05]
    clear = contact_clearance(heights, spans)
    assert np.abs(clear - up)[15:].max() <= abs(drift) * 0.3 + 1e-9


def slide_of(shape, clip, stands, plan):
    """Returns the speeds in cm/s of the lowest points of standing feet and of feet that land or leave, and
    the heights in metres of feet in mid-swing.
    """
    result = retarget(shape, clip, plan)
    moments = np.arange(len(clip.turns)) * STEP
    at = np.array(list(compute_posed_surfaces(result.project, shape.id, moments))) - [
        0.0,
        floor_height_under(shape),
        0.0,
    ]
    speeds, edges, swinging = [], [], []
    for side in (0, 1):
        foot = at[:, len(at[0]) - 24 + 12 * side :][:, :12]
        between = 0.5 * (foot[1:, :, 1] + foot[:-1, :, 1])
        speed = np.linalg.norm(np.diff(foot, axis=0)[..., [0, 2]], axis=2) / STEP
        lowest = between < between.min(1, keepdims=True) + 0.005
        along = np.array([np.median(some[which]) for some, which in zip(speed, lowest, strict=True)])
        on = stands[1:, side] & stands[:-1, side] & (between.min(1) < 0.005)
        assert on.sum() > 0.7 * stands[:, side].sum(), "the foot is on the floor while the performer's is"
        speeds.append(100.0 * along[on])
        edges.append(100.0 * along[stands[1:, side] != stands[:-1, side]])
        # The first and the last third of a swing are excluded, because the foot leaves and lands in them.
        wide = np.convolve(stands[:, side], np.ones(11), "same") > 0
        swinging.append(foot[~wide, :, 1].min(1))
    return np.concatenate(speeds), np.concatenate(edges), np.concatenate(swinging), result


GAITS = [(1.2, 0.6, 0.4), (3.0, 0.2, 0.45), (4.5, 0.13, 0.45)]
"""Speed (m/s), stance and swing (s): a walk and two runs."""


@pytest.mark.parametrize("how", GAITS, ids=["walk", "run", "fast run"])
@pytest.mark.parametrize(("shin", "tip"), [(0.75, 0.28), (1.3, 0.22), (1.0, 0.17)])
def test_feet_that_roll_from_heel_to_toe_neither_slide_nor_scuff(how, shin, tip):
    """This also holds on the performer's own skeleton."""
    clip, stands = gait(*how)
    shape = shod(short_shinned(shin), tip)
    plan = replace(create_automatic_plan(clip, shape), travel=True, pin=True)
    speeds, edges, swinging, result = slide_of(shape, clip, stands, plan)
    assert np.median(speeds) < 1.0 and np.percentile(speeds, 90) < SLIDE
    assert np.percentile(edges, 90) < (SLIDE if how != GAITS[-1] else 10.0), "feet land and leave vertically"
    assert np.percentile(swinging, 5) > CLEAR
    limbs = measure_quality(result.project, shape.id, clip, result.duration, plan).limbs
    legs = [limb for limb in limbs if "thigh" in limb.limb or "shin" in limb.limb]
    assert legs and max(limb.median for limb in legs) < 3.0
    # A foot is held next to each contact, which leaves less time for the short swing of a fast run.
    assert max(limb.p90 for limb in legs) < (10.0 if how == GAITS[-1] else 8.0)


@pytest.mark.parametrize("how", GAITS)
def test_the_made_performer_does_not_slide(how):
    clip, stands = gait(*how)
    places, skeleton = joint_places(clip), clip.skeleton
    for side, name in ((0, "Left"), (1, "Right")):
        ankle, turns = (
            places[:, skeleton.index(f"{name} ankle")],
            clip.turns[:, skeleton.index(f"{name} toe")],
        )
        tip, heel = (ankle + rotate(turns, way) for way in (TOE, HEEL))
        on = stands[1:, side] & stands[:-1, side]
        low = np.where((tip[1:, 1] < heel[1:, 1])[:, None], np.diff(tip, axis=0), np.diff(heel, axis=0))
        assert np.abs(low[on]).max() < 1e-4 and np.abs(np.minimum(tip, heel)[stands[:, side], 1]).max() < 1e-3


def test_a_long_take_is_planted_in_blocks_that_do_not_show(monkeypatch):
    clip, _ = gait(1.2, 0.6, 0.4)
    shape = shod(short_shinned(1.3), 0.22)
    plan = replace(create_automatic_plan(clip, shape), travel=True, pin=True)
    at_once = retarget(shape, clip, plan)
    monkeypatch.setattr("enliven.mapping.legs.sole._FRAMES_PER_BLOCK", 7)
    parts = retarget(shape, clip, plan)
    times = np.linspace(0.0, clip.duration, 50)
    first, second = (Player(each.project, shape.id).sample(times)[1] for each in (at_once, parts))
    np.testing.assert_allclose(first, second, atol=1e-9)


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 1000))
def test_spin_is_the_turn_about_the_vertical_of_the_part_that_touches(seed):
    """A shoe that pitches does not spin. If it turns about the vertical as well, it spins by that angle."""
    random = np.random.default_rng(seed)
    shape = shod(man(), 0.2)
    toe = shape.skeleton.index("Left toe")
    angles, count = np.cumsum(random.uniform(-0.05, 0.05, 60)), 60
    pitch = from_rotation_vector(np.cumsum(random.uniform(-0.02, 0.02, count))[:, None] * [1.0, 0.0, 0.0])
    joints = np.tile(shape.skeleton.positions, (count, 1, 1))
    spins = []
    for about in (0.0 * angles, angles):
        turns = np.tile([1.0, 0.0, 0.0, 0.0], (count, len(shape.skeleton), 1))
        turns[:, toe] = multiply(from_rotation_vector(about[:, None] * [0.0, 1.0, 0.0]), pitch)
        spins.append(Sole(shape, [toe]).compute_accumulated_rotation(turns, joints))
    # The worst of all 1,000 seeds is 1.5e-3: the turns of a frame are added up to second order.
    np.testing.assert_allclose(spins[0], 0.0, atol=2e-3)
    np.testing.assert_allclose(spins[1], angles - angles[0], atol=2e-3)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 1000), size=st.floats(0.0, 6.0))
def test_a_foot_that_stands_keeps_its_heading_unless_it_turns_far(seed, size):
    random = np.random.default_rng(seed)
    spin, spans = size * np.cumsum(random.normal(size=90)) / 30.0, ((5, 30), (40, 50), (52, 55), (75, 89))
    turns = remove_spin(spin, spans, STEP)
    assert np.abs(turns).max() <= np.radians(30.0) + 1e-12
    for first, last in ((5, 30), (40, 55), (75, 89)):
        heading = (spin + turns)[first : last + 1]
        if np.ptp(spin[first : last + 1]) < np.radians(30.0):
            assert np.ptp(heading) < 1e-12
        assert np.ptp(heading) <= np.ptp(spin[first : last + 1]) + 1e-12
    assert turns[65] == 0.0 and remove_spin(spin, (), STEP).max() == 0.0
    # A foot does not jerk into its heading: 30 degrees take 0.1 s, from one contact to the next twice that.
    eased = 2.0 * 1.5 * np.radians(30.0) * STEP / 0.1
    assert np.abs(np.diff(spin + turns)).max() < 2.0 * np.abs(np.diff(spin)).max() + eased


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 1000), rate=st.floats(0.0, 3.0))
def test_a_stepping_foot_turns_while_it_swings(seed, rate):
    random = np.random.default_rng(seed)
    heading = rate * np.cumsum(random.uniform(-1.0, 2.0, 240)) * STEP
    edges = np.cumsum(random.integers(14, 35, 8))
    spans = tuple((int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b < 240)
    held = hold_heading(heading, spans, STEP)
    for first, last in spans:
        allowed = np.ptp(heading[first : last + 1]) <= np.radians(30.0)
        assert np.ptp(held[first : last + 1]) < 1e-9 or not allowed
    assert np.abs(held - heading)[: edges[-1]].max() <= np.radians(30.0) + 1e-9
    assert np.array_equal(hold_heading(heading, (), STEP), heading)


@pytest.mark.parametrize("rate", [1.0, 2.0])
def test_feet_of_a_performer_that_turn_while_they_stand_do_not_slide(rate):
    """As in captured runs, feet rotate about the vertical by a few degrees in each contact."""
    clip, stands = gait(3.0, 0.2, 0.45)
    turns = clip.turns.copy()
    for side, name in ((0, "Left"), (1, "Right")):
        about = np.where(stands[:, side], rate * STEP * (_since(stands[:, side]) - 6.0), 0.0)
        toe = clip.skeleton.index(f"{name} toe")
        turns[:, toe] = multiply(from_rotation_vector(about[:, None] * [0.0, 1.0, 0.0]), turns[:, toe])
    clip, shape = replace(clip, turns=turns), shod(short_shinned(1.0), 0.22)
    speeds, *_ = slide_of(
        shape, clip, stands, replace(create_automatic_plan(clip, shape), travel=True, pin=True)
    )
    assert np.median(speeds) < 1.0 and np.percentile(speeds, 90) < SLIDE


def _since(stands):
    """Returns (F,) the number of frames since the foot landed."""
    count, counts = 0, []
    for on in stands:
        count = count + 1 if on else 0
        counts.append(count)
    return np.array(counts, float)


@pytest.mark.parametrize("how", GAITS[:2], ids=["walk", "run"])
@settings(deadline=None, max_examples=3)
@given(share=st.floats(0.4, 0.45))
def test_soles_that_move_with_the_shin_do_not_slide(how, share):
    """Skin that the shin moves in part slides when the leg bends, unless the foot corrects it."""
    clip, stands = gait(*how)
    shape = with_soft_soles(shod(short_shinned(1.3), 0.22), share)
    speeds, *_ = slide_of(
        shape, clip, stands, replace(create_automatic_plan(clip, shape), travel=True, pin=True)
    )
    assert np.median(speeds) < 0.4 and np.percentile(speeds, 90) < 4.0


@pytest.mark.parametrize(("width", "extra"), [(4.0, 0.0), (8.0, 0.0), (4.0, 0.06)])
def test_legs_keep_their_pose_if_wide_hips_sway_over_planted_feet(width, extra):
    """This also holds if one leg is longer than the other."""
    clip, shape = sway(np.radians(3.0), np.radians(8.0)), shod(wide_hipped(width, extra), 0.2)
    stands = np.ones((len(clip.turns), 2), bool)
    plan = replace(create_automatic_plan(clip, shape), travel=True, pin=True)
    speeds, *_, result = slide_of(shape, clip, stands, plan)
    assert np.median(speeds) < 0.5 and np.percentile(speeds, 90) < SLIDE
    limbs = measure_quality(result.project, shape.id, clip, result.duration, plan).limbs
    legs = [limb for limb in limbs if "thigh" in limb.limb or "shin" in limb.limb]
    arms = [limb for limb in limbs if "arm" in limb.limb]
    assert legs and max(limb.median for limb in legs) < 1.5 and max(limb.p90 for limb in legs) < 4.0
    assert arms and max(limb.p90 for limb in arms) < 1.0


def wide_hipped(width, extra):
    """Returns a man with hips ``width`` times as far apart, and a left thigh that is longer by ``extra``."""
    skeleton = man()
    at = skeleton.positions.copy()
    for side in ("Left", "Right"):
        hip = skeleton.index(f"{side} hip")
        for j in skeleton.list_subtree(hip):
            at[j, 0] += (width - 1.0) * skeleton.positions[hip, 0]
        if side == "Left":
            at[hip, 1] += extra
    return Skeleton(skeleton.names, skeleton.parents, at)


def with_soft_soles(shape, share):
    """Returns the shape with shins that move its feet by a fraction ``share``."""
    skeleton, indices, weights = shape.skeleton, shape.skin.indices.copy(), shape.skin.weights.copy()
    for side, foot in (("Left", slice(-24, -12)), ("Right", slice(-12, None))):
        indices[foot], weights[foot] = 0, 0.0
        indices[foot, :2] = skeleton.index(f"{side} toe"), skeleton.index(f"{side} ankle")
        weights[foot, :2] = 1.0 - share, share
    return shape.with_changes(skin=replace(shape.skin, indices=indices, weights=weights))
