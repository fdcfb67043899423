"""Tests of the floor: standing models touch it, only leaps leave it, and quadrupeds stay level."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_bodies import horse, man, random_motion, shape_with_markers, snake, spider, walk

from enliven.document.clip import Clip
from enliven.document.skeleton import Skeleton
from enliven.mapping.automatic_mapping import create_automatic_plan, retarget
from enliven.mapping.ground import (
    body_points,
    compute_posed_surfaces,
    floor_height_under,
    leap_heights,
    level_root,
    stands_on_floor,
)
from enliven.mapping.quality import measure_quality
from enliven.motion.layers.evaluate import Player
from enliven.rotation import from_rotation_vector, multiply, rotate

SEEDS = st.integers(0, 10_000)


def lowest(made, times):
    return np.array([at[:, 1].min() for at in compute_posed_surfaces(made.project, made.shape_id, times)])


@settings(max_examples=4, deadline=None)
@given(SEEDS, st.booleans())
def test_the_lowest_point_of_what_stands_is_on_the_floor(seed, travel):
    clip = random_motion(np.random.default_rng(seed), man(), frames=5, size=0.5)
    clip = replace(clip, root=clip.root * [1, 0, 1] + [0, 0.9, 0])
    for target in (horse(), spider(), man()):
        shape = shape_with_markers("target", target)
        result = retarget(shape, clip, replace(create_automatic_plan(clip, shape), travel=travel, turn=False))
        if travel and target.names == clip.skeleton.names:
            continue
        frames = np.arange(5) * clip.step
        leap = leap_heights(clip) if travel else np.zeros(5)
        off = lowest(result, frames) - floor_height_under(shape)
        np.testing.assert_allclose(off[leap == 0.0], 0.0, atol=1e-5)
        assert (off > -1e-5).all()


def test_a_leap_is_a_leap_and_a_handstand_stands():
    """The root and all joints rise by half a metre in the middle. Then the whole body is turned upside
    down.
    """
    still = random_motion(np.random.default_rng(1), man(), frames=1)
    turns, root = np.repeat(still.turns, 9, 0), np.repeat(still.root, 9, 0)
    root[4, 1] += 0.5
    clip = replace(still, turns=turns, root=root)
    np.testing.assert_allclose(leap_heights(clip)[[0, 3, 5, 8]], 0.0)
    assert 0.35 < leap_heights(clip)[4] < 0.5
    over = turns.copy()
    over[5:] = multiply(np.array([0.0, 1.0, 0.0, 0.0]), turns[5:])
    upside = replace(still, turns=over, root=np.repeat(still.root, 9, 0))
    shape = shape_with_markers("horse", horse())
    result = retarget(shape, upside, replace(create_automatic_plan(upside, shape), level=False, rest="first"))
    top = max(horse().positions[:, 1])
    upright, inverted = (
        Player(result.project, "horse").compute_root(np.array([t]))[0, 1] for t in (0.0, 0.8)
    )
    assert inverted == pytest.approx(top - upright, abs=0.1)
    assert lowest(result, np.array([0.0, 0.2, 0.5, 0.8])) == pytest.approx(
        floor_height_under(shape), abs=1e-5
    )


def test_what_swims_or_flies_keeps_its_height():
    clip, shape = random_motion(np.random.default_rng(2), man()), shape_with_markers("snake", snake())
    raised = replace(snake(), positions=snake().positions + np.array([0.0, 3.0, 0.0]))
    assert stands_on_floor(shape_with_markers("horse", horse()))
    flying = shape_with_markers("flying", raised)
    assert not stands_on_floor(flying)
    result = retarget(flying, clip)
    assert result.project.shape("flying").travel is None
    still = Player(result.project, "flying").compute_root(np.array([0.0, 0.5]))
    np.testing.assert_allclose(still, np.repeat(flying.skeleton.positions[:1], 2, 0))
    assert shape.place.shape == (3,)


@settings(max_examples=10, deadline=None)
@given(SEEDS)
def test_a_levelled_take_only_heads_and_its_limbs_stay(seed):
    skeleton = man()
    clip = random_motion(np.random.default_rng(seed), skeleton, size=0.6)
    level = level_root(clip, skeleton.index("chest"))
    up = rotate(level.turns[:, 0], np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(up, np.tile([0.0, 1.0, 0.0], (len(up), 1)), atol=1e-12)
    np.testing.assert_array_equal(level.turns[:, 1:], clip.turns[:, 1:])


def test_upside_down_it_heads_where_it_did():
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (3, len(man()), 1))
    turns[0] = from_rotation_vector(np.array([0.0, 0.7, 0.0]))
    turns[1] = multiply(from_rotation_vector(np.array([np.pi, 0.0, 0.0])), turns[0])
    level = level_root(Clip("c", man(), turns, np.zeros((3, 3)), 0.1), 2)
    np.testing.assert_allclose(level.turns[1, 0], level.turns[0, 0], atol=1e-12)


def test_a_stride_is_the_models_own():
    """Legs that swing half as far move the body half as far, so that standing feet do not slide."""
    skeleton = man()
    swing = 0.4 * np.sin(np.linspace(0, 2 * np.pi, 41))
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (41, len(skeleton), 1))
    for side, sign in (("Left", 1), ("Right", -1)):
        for name in ("knee", "ankle", "toe"):
            about = np.zeros((41, 3))
            about[:, 0] = sign * swing
            turns[:, skeleton.index(f"{side} {name}")] = from_rotation_vector(about)
    root = np.tile(skeleton.positions[0], (41, 1))
    root[:, 2] += np.linspace(0, 1.3, 41)
    clip, shape = Clip("walk", skeleton, turns, root, 1 / 30), shape_with_markers("spider", spider())
    plan = replace(create_automatic_plan(clip, shape), travel=True, steps=False)

    def way(weight):
        chains = tuple(replace(c, weight=weight) if "leg" in c.role else c for c in plan.chains)
        result = retarget(shape, clip, replace(plan, chains=chains))
        at = Player(result.project, "spider").compute_root(np.array([0.0, result.duration]))
        return float(np.linalg.norm((at[1] - at[0])[[0, 2]]))

    assert 1.2 * way(0.2) < way(0.4) < way(0.8) / 1.2


def armed(name, length, hold="Right wrist"):
    """Returns a man with an object of a length (metres) that extends sideways from a joint."""
    skeleton = man()
    end = skeleton.positions[skeleton.index(hold)] - [length, 0.0, 0.0]
    parents = [*skeleton.parents, skeleton.index(hold)]
    return Skeleton(
        (*skeleton.names, name), np.array(parents), np.concatenate([skeleton.positions, end[None]])
    )


@pytest.mark.parametrize(("name", "length"), [("stick", 1.3), ("Sword.R", 1.3), ("prop_01", 1.1)])
def test_a_weapon_that_reaches_the_floor_is_not_a_foot(name, length):
    """When the arms hang, the weapon passes through the floor, and the feet stay on the floor."""
    shape, clip = shape_with_markers("armed", armed(name, length)), walk(0.3)
    body = body_points(shape)
    np.testing.assert_array_equal(np.flatnonzero(~body), np.arange(len(body))[-3:])
    plan = replace(create_automatic_plan(clip, shape), travel=True)
    result = retarget(shape, clip, plan)
    at = np.array(
        list(compute_posed_surfaces(result.project, "armed", np.linspace(0.0, result.duration, 20)))
    )
    assert at[:, ~body, 1].min() < floor_height_under(shape) - 0.2
    np.testing.assert_allclose(at[:, body, 1].min(1), floor_height_under(shape), atol=0.002)
    quality = measure_quality(result.project, "armed", clip, result.duration, plan)
    assert quality.slide < 25.0 and quality.sunk < 0.01 and quality.afloat < 0.01


def test_hands_and_short_rods_are_body():
    assert body_points(shape_with_markers("man", man())).all()
    assert body_points(shape_with_markers("armed", armed("rod", 0.2))).all()
    assert not body_points(shape_with_markers("armed", armed("Dagger", 0.2))).all()
    assert body_points(shape_with_markers("horse", horse())).all()
    turret = replace(snake(), names=tuple(f"gun {k}" if k > 2 else f"base {k}" for k in range(len(snake()))))
    assert body_points(shape_with_markers("turret", turret)).all(), "without arms nothing is carried"
