"""Tests of locomotion: feet stand still, jumps follow gravity, and the timeline may set contacts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document.locomotion import LocomotionSettings, Switch
from enliven.errors import InputError
from enliven.examples.spacetime.anchoring import choose_anchors
from enliven.examples.spacetime.locomotion import find_feet_on_floor, find_switches, place_motion

STEP = 1 / 60
FREE = LocomotionSettings(landing="free")


def walker(frames, seed=0):
    """Returns two feet that step in turn and a head, in the mesh's frame, and a yaw angle."""
    rng = np.random.default_rng(seed)
    t = np.arange(frames) * STEP
    phase = 2 * np.pi * rng.uniform(0.7, 1.4) * t
    left = np.stack([0 * t + 0.1, -1 + 0.1 * np.maximum(np.sin(phase), 0), 0.3 * np.cos(phase)], 1)
    right = np.stack([0 * t - 0.1, -1 + 0.1 * np.maximum(-np.sin(phase), 0), -0.3 * np.cos(phase)], 1)
    head = np.stack([0.02 * np.sin(phase), 0 * t + 0.7, 0 * t], 1)
    return np.stack([left, right, head], 1), rng.uniform(-1, 1) * t


@given(st.integers(0, 10**6))
@settings(max_examples=20, deadline=None)
def test_the_anchor_does_not_slide_and_nothing_goes_under(seed):
    places, yaw = walker(120, seed)
    placed = place_motion(places, yaw, STEP, [Switch(0, "contact")], [0, 1])
    assert placed.world[:, :2, 1].min() > -1e-9
    assert np.abs(placed.world[:, :2, 1].min(1)).max() < 1e-9
    for f in range(1, 120):
        anchor = placed.anchors[f]
        np.testing.assert_allclose(placed.world[f, anchor, ::2], placed.world[f - 1, anchor, ::2], atol=1e-9)
    assert len(set(placed.anchors)) == 2
    assert np.linalg.norm(np.ptp(placed.root[:, ::2], axis=0)) > 0.5


@given(st.integers(0, 10**6))
@settings(max_examples=20, deadline=None)
def test_jumping_puppet_lands_with_the_performer(seed):
    places, yaw = walker(120, seed)
    switches = [Switch(0, "contact"), Switch(40, "flight"), Switch(70, "contact")]
    placed = place_motion(places, 0 * yaw, STEP, switches, [0, 1])
    flying = placed.anchors < 0
    assert np.array_equal(np.flatnonzero(flying), np.arange(40, 70))
    high = placed.world[39:71, :2, 1].min(1)
    airborne = np.flatnonzero(high[1:-1] > 1e-9) + 40
    way = placed.root[39:71, 1]
    inside = [f for f in airborne if f - 1 in airborne and f + 1 in airborne]
    falls = [(way[f - 40] - 2 * way[f - 39] + way[f - 38]) / STEP**2 for f in inside]
    np.testing.assert_allclose(falls, -9.81, rtol=1e-6)
    assert len(inside) > 20
    np.testing.assert_allclose(
        np.diff(placed.root[40:70, ::2], axis=0),
        np.tile(placed.root[41] - placed.root[40], (29, 1))[:, ::2],
        atol=1e-9,
    )


def test_free_flight_follows_gravity():
    places, yaw = walker(120)
    # It extends its legs at 2 m/s before it leaves the floor.
    places[:, :2, 1] = -1.0 - np.interp(np.arange(120), [0, 30, 39], [0, 0, 9 * STEP * 2.0])[:, None]
    placed = place_motion(places, 0 * yaw, STEP, [Switch(0, "contact"), Switch(40, "flight")], [0, 1], FREE)
    airborne = int((placed.anchors < 0).sum())
    assert abs(airborne * STEP - 2 * 2.0 / 9.81) < 0.15
    assert placed.switches[-1].kind == "contact"
    assert placed.world[:, :2, 1].min() > -1e-9


def test_contact_and_flight_are_found():
    frames = 240
    feet = np.zeros((frames, 2, 3))
    feet[:, 1, 0] = 0.2
    feet[100:130, :, 1] = (0.4 * np.sin(np.linspace(0, np.pi, 32)[1:-1]))[:, None]
    feet[180:210, 0, 1] = 0.3
    switches = find_switches(feet, STEP, 0.9)
    assert [s.kind for s in switches] == ["contact", "flight", "contact"]
    assert abs(switches[1].frame - 100) <= 3
    assert abs(switches[2].frame - 130) <= 3


def test_couplings_make_the_change_of_anchors_level():
    places, yaw = walker(120, 3)
    placed = place_motion(places, yaw, STEP, [Switch(0, "contact")], [0, 1])
    couplings = placed.create_level_constraints(("left", "right", "head"))
    assert couplings
    for coupling in couplings:
        assert {coupling.point, coupling.other} == {"left", "right"}
        assert coupling.point == ("left", "right")[placed.anchors[coupling.frame]]


@pytest.mark.parametrize("frames", [[], [3], [0, 50, 40], [0, 500]])
def test_switches_must_be_in_order(frames):
    places, yaw = walker(120)
    with pytest.raises(InputError, match="switches have invalid frames"):
        place_motion(places, yaw, STEP, [Switch(f, "contact") for f in frames], [0, 1])


@given(st.integers(0, 10**6))
@settings(max_examples=20, deadline=None)
def test_the_foot_that_the_performer_stands_on_is_the_anchor(seed):
    rng = np.random.default_rng(seed)
    places, yaw = walker(120, seed)
    stands = rng.random((120, 2)) < 0.7
    placed = place_motion(places, yaw, STEP, [Switch(0, "contact")], [0, 1], stands=stands)
    for f in range(120):
        if stands[f].any():
            assert stands[f, placed.anchors[f]]
        if f > 0 and stands[f, placed.anchors[f - 1]]:
            assert placed.anchors[f] == placed.anchors[f - 1]
    assert placed.world[:, :2, 1].min() > -1e-9


def test_shuffling_puppet_moves_by_the_performers_feet():
    """The mesh hardly lifts its feet. Chosen by their heights, the wrong foot would stand."""
    t = np.arange(240) * STEP
    phase = 2 * np.pi * t
    ways = [np.cos(phase), -np.cos(phase)]
    lifts = [np.maximum(np.sin(phase + np.pi), 0), np.maximum(np.sin(phase), 0)]
    feet = [
        np.stack([0 * t, 0.2 * lift, 0.3 * way + 0.6 * t], 1) for way, lift in zip(ways, lifts, strict=True)
    ]
    stands = np.stack([lift == 0.0 for lift in lifts], 1)
    places = np.stack(
        [np.stack([0 * t, 0.001 * lift, 0.3 * way], 1) for way, lift in zip(ways, lifts, strict=True)], 1
    )
    how = [Switch(0, "contact")]
    kept = place_motion(places, 0 * t, STEP, how, [0, 1])
    goes = place_motion(places, 0 * t, STEP, how, [0, 1], stands=stands)
    assert abs(kept.root[-1, 2]) < 0.7
    assert goes.root[-1, 2] > 4.0
    assert np.diff(goes.root[:, 2]).min() > -1e-6
    seen = find_feet_on_floor(np.stack(feet, 1), STEP, 1.0)
    assert (seen == stands).mean() > 0.5


def slow_stand(turned, feet, stands, grip, root, anchors):
    """Computes the contact frame by frame, as a slow reference for the compiled version."""
    for f in range(len(turned)):
        heights = turned[f, feet, 1]
        before = anchors[f - 1] if f else -1
        if stands[f].any():
            anchor = (
                before if before in feet[stands[f]] else feet[np.where(stands[f], heights, np.inf).argmin()]
            )
        elif before >= 0 and turned[f, before, 1] <= heights.min() + grip:
            anchor = before
        else:
            anchor = feet[heights.argmin()]
        anchors[f] = anchor
        if f:
            root[f] = root[f - 1] + turned[f - 1, anchor] - turned[f, anchor]
        root[f, 1] = -heights.min()


@given(st.integers(0, 10**6), st.booleans())
@settings(max_examples=20, deadline=None)
def test_compiled_contact_is_its_slow_twin(seed, known):
    rng = np.random.default_rng(seed)
    turned, feet = rng.normal(size=(60, 5, 3)) * 0.1, np.array([3, 0, 2])
    stands = rng.random((60, 3)) < 0.4 if known else np.zeros((60, 3), np.bool_)
    compiled, twin = [(np.zeros((60, 3)), np.full(60, -1, np.int64)) for _ in range(2)]
    choose_anchors(turned, feet, stands, 0.05, 0, 59, *compiled)
    slow_stand(turned, feet, stands, 0.05, *twin)
    np.testing.assert_array_equal(compiled[1], twin[1])
    np.testing.assert_allclose(compiled[0], twin[0], atol=1e-12)
