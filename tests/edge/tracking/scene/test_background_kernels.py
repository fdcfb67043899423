"""Tests of the background model's kernels against slow versions, pixel by pixel."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_edge.tracking.scene.background_kernels import (
    BACKGROUND,
    FOREGROUND,
    UNLIKELY,
    UNSEEN,
    BackgroundState,
    LearningRate,
    classify_pixels,
    empty_background,
    guard_people,
    learn_frame,
)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_pixel_classes_match_the_slow_reference(seed):
    random, shape = np.random.default_rng(seed), (9, 11)
    z, background, likely = (random.uniform(0.2, 5.0, shape) * (random.random(shape) < 0.8) for _ in range(3))
    points = random.uniform(-0.3, 2.0, (*shape, 3))
    kind = classify_pixels(z, points, background, likely, 0.4, 4.5, 0.05)
    for at in np.ndindex(shape):
        nearer = z[at] - np.array([background[at], likely[at]]) < -(0.05 + 0.012 * z[at] ** 2)
        if not 0.4 < z[at] < 4.5 or points[at][1] <= 0.05:
            expected = BACKGROUND
        elif background[at] > 0:
            expected = FOREGROUND if nearer[0] else BACKGROUND
        else:
            expected = UNSEEN if nearer[1] or likely[at] == 0 else UNLIKELY
        assert kind[at] == expected


@given(st.integers(0, 10_000), st.integers(0, 4))
@settings(max_examples=25, deadline=None)
def test_guarded_pixels_match_the_slow_reference(seed, people):
    random, shape = np.random.default_rng(seed), (9, 11)
    ids = random.permutation(8)[:people] - 1
    owner, guarded = random.integers(-1, people, shape), random.integers(-1, 8, shape)
    z, guard_z = random.random(shape), random.random(shape)
    expected = [np.where(np.isin(guarded, ids), -1, guarded), guard_z.copy()]
    for at in np.argwhere(owner >= 0):
        expected[0][tuple(at)], expected[1][tuple(at)] = ids[owner[tuple(at)]], z[tuple(at)]
    guard_people(owner, ids, z, guarded, guard_z)
    np.testing.assert_array_equal([guarded, guard_z], expected)


def learnt_alone(p: dict, d: float, person: bool, hold: bool, rate: LearningRate) -> tuple[int, int, int]:
    """Learns one pixel in plain Python with the names of :class:`BackgroundState`, as a slow reference."""
    margin, step = 0.04 + 0.010 * d * d, rate.step
    if p["z"] == 0.0:
        if abs(d - p["still_z"]) <= 0.01 + 0.004 * d * d:
            p["still"] += step
            p["still_z"] += 0.1 * (d - p["still_z"])
        else:
            p["still"] -= 2.0 * step
            if p["still"] <= 0.0:
                p["still_z"], p["still"] = d, 0.0
    if person:
        return 0, 0, 0
    if d == 0.0:
        if p["z"] == 0.0:
            p["waited"] = max(0.0, p["waited"] - 2.0 * step)
        elif rate.dark < np.inf:
            p["away"] += step
            if p["away"] > rate.dark:
                p["z"] = p["away"] = p["waited"] = 0.0
        return 0, 0, 0
    is_known = p["z"] > 0.0
    if not is_known and not hold:
        same = abs(d - p["nearer"]) <= margin
        if rate.seen_for == 0.0 or (same and p["waited"] + step > rate.seen_for):
            p["z"], p["waited"] = d, 0.0
            return 0, 0, 0
    if is_known and abs(d - p["z"]) <= margin:
        p["z"] += min(1.0, 0.3 * step) * (d - p["z"])
        p["flips"] = -abs(p["flips"]) * (1.0 - 0.1 * step)
        p["waited"] = max(0.0, p["waited"] - step)
        p["away"], p["guarded"] = 0.0, -1
        return 1, 0, 0
    if is_known and d > p["z"]:
        p["guarded"], p["waited"] = -1, max(0.0, p["waited"] - step)
        p["away"] += step
        if p["away"] > rate.clear_after:
            p["nearer"], p["waited"] = p["z"], 0.7 * rate.absorb_after
            p["z"], p["away"] = d, 0.0
        return 1, 0, 1
    p["away"] = 0.0
    counted = (int(is_known), int(is_known), 0)
    if p["guarded"] >= 0 and abs(d - p["guard_z"]) <= 2.0 * margin:
        return counted
    if p["flips"] <= 0.0 and not hold and abs(d - p["nearer"]) <= 2.0 * margin:
        p["flips"] = 1.0 - p["flips"]
        if p["flips"] > 6.0 and is_known:
            p["z"], p["flips"] = p["nearer"], 0.0
            return counted
    if abs(d - p["nearer"]) <= margin:
        p["waited"] += step
        p["nearer"] += 0.2 * (d - p["nearer"])
        if p["waited"] > rate.absorb_after:
            p["z"], p["waited"] = p["nearer"], 0.0
        return counted
    p["waited"] -= 2.0 * step
    if p["waited"] <= 0.0:
        p["nearer"], p["waited"] = d, 0.0
    return counted


@given(st.integers(0, 10_000), st.booleans(), st.booleans())
@settings(max_examples=60, deadline=None)
def test_learning_a_frame_matches_the_slow_reference(seed, dark, at_once):
    """From any state, with background, nearer, farther and no depth, on people and candidates.

    Seconds and depths have single precision in the state; random numbers are farther from any threshold.
    """
    random, shape = np.random.default_rng(seed), (7, 21)
    room = random.uniform(0.5, 4.0, shape) * (random.random(shape) < 0.7)
    z = np.where(
        random.random(shape) < 0.6, room + random.normal(0, 0.05, shape), random.uniform(0.5, 4, shape)
    )
    z = np.maximum(z, 0.0) * (random.random(shape) < 0.9)
    state = empty_background(shape)
    state.z[:] = room
    for name in ("nearer", "guard_z", "still_z"):
        near = np.where(random.random(shape) < 0.5, z, room)
        getattr(state, name)[:] = near + random.normal(0, 0.05, shape)
    for name in ("waited", "away", "still"):
        getattr(state, name)[:] = random.uniform(0, 3, shape) * (random.random(shape) < 0.7)
    state.flips[:] = random.uniform(-7, 7, shape)
    state.guarded[:] = random.integers(-1, 3, shape)
    person, hold = random.random((2, *shape)) < 0.2
    step, seen_for = random.uniform(0.01, 0.5), 0.0 if at_once else 0.25
    rate = LearningRate(step, 2.0, 1.0, seen_for, 2.0 if dark else np.inf)
    pixels = {
        at: {name: float(getattr(state, name)[at]) for name in BackgroundState._fields}
        for at in np.ndindex(shape)
    }
    counted = np.sum([learnt_alone(p, z[at], person[at], hold[at], rate) for at, p in pixels.items()], axis=0)
    assert learn_frame(z, person, hold, state, rate) == tuple(counted)
    for name in BackgroundState._fields:
        slow = np.reshape([p[name] for p in pixels.values()], shape)
        np.testing.assert_allclose(getattr(state, name), slow, atol=2e-6, err_msg=name)
