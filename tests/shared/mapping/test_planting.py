"""Planted feet: contacts are found at any pace, feet stand still, and legs keep their pose."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_bodies import man, meshed, walk

from enliven.document.skeleton import Skeleton
from enliven.mapping.automatic_mapping import automatic, retarget
from enliven.mapping.ground import floor_of, surfaces
from enliven.mapping.planting import PosedLeg, planted, standing_spans
from enliven.mapping.quality import quality_of
from enliven.motion.layers.evaluate import Player

STEP = 1 / 60


def steps_of(speed, stance_s, swing_s=0.35, rounds=4, seed=0):
    """A foot (T, 3), the root (T, 3) over it at a speed (m/s), and the moments in which the foot stands."""
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
    found = np.zeros(len(foot), bool)
    for first, last in standing_spans(foot, root, STEP, 0.85):
        found[first : last + 1] = True
    edges = np.convolve(np.abs(np.diff(stands.astype(int), prepend=0)), np.ones(7), "same") > 0
    assert (found == stands)[~edges].all(), "but for three frames at the ends of each contact"
    assert found.sum() > 0.6 * stands.sum()


def test_a_foot_that_is_lifted_on_the_spot_or_glides_does_not_stand():
    times = np.arange(120)[:, None] * STEP
    still = np.tile([0.0, 0.9, 0.0], (120, 1))
    lifted = np.clip(np.sin(2 * np.pi * times), 0.0, None) * [0.0, 0.4, 0.0]
    for first, last in standing_spans(lifted, still, STEP, 0.85):
        assert lifted[first : last + 1, 1].max() < 0.1
    glides = times * [0.0, 0.0, 3.0]
    assert standing_spans(glides, np.add(glides, [0.0, 0.9, 0.0]), STEP, 0.85) == ()


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 1000), speed=st.floats(0.5, 6.0), longer=st.floats(0.7, 1.4))
def test_the_foot_that_stands_is_still_and_on_the_floor(seed, speed, longer):
    """A body with a foot that goes farther or less far than its performer's beside the hips."""
    foot, root, _ = steps_of(speed, 0.3, seed=seed)
    spans = standing_spans(foot, root, STEP, 0.85)
    own = (foot - root) * [1.0, 1.0, longer]
    leg = PosedLeg(own, foot, own[:, 1] - 0.03, foot[:, 1] - 0.03, spans)
    way, (offset,) = planted([leg], root, STEP, 0.0)
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
    way, (offset,) = planted([PosedLeg(still, root, still[:, 0], still[:, 0], ())], root, STEP, 0.0)
    np.testing.assert_array_equal(way, root)
    assert not offset.any()


def short_shinned(shin):
    """A man with shins of another length, standing on the floor."""
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
    shape, clip = meshed("man", short_shinned(shin)), walk(0.4)
    plan = replace(automatic(clip, shape), travel=True, pin=True)
    made = retarget(shape, clip, plan)
    quality = quality_of(made.project, "man", clip, made.duration, plan)
    legs = [limb for limb in quality.limbs if "thigh" in limb.limb or "shin" in limb.limb]
    assert legs and max(limb.median for limb in legs) < 4.0 and quality.slide < 3.0
    low = [at[:, 1].min() for at in surfaces(made.project, "man", np.linspace(0.0, made.duration, 20))]
    assert min(low) > floor_of(shape) - 1e-3
    free = retarget(shape, clip, replace(plan, pin=False))
    ways = [Player(one.project, "man").root(np.array([0.0, clip.duration])) for one in (made, free)]
    assert np.linalg.norm(ways[0][1] - ways[0][0]) > 0.5 * np.linalg.norm(ways[1][1] - ways[1][0])
