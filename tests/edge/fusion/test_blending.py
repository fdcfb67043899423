"""Tests of the compiled mean of several sensors' data, against a slow reference."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven_edge.fusion.live.blending import (
    blend,
    bones_within,
    doubt_outliers,
    fuse_confidence,
    side_costs,
    trunk_distances,
)
from enliven_edge.fusion.live.side_assignment import (
    MIDLINE_JOINTS,
    OTHER_SIDE,
    midline_points,
    midline_weights,
)

LATERAL = np.arange(20) != OTHER_SIDE
"""(20,) True for joints with a left and a right side."""


def slow_blend(x, w, predicted, known, before, d, share):
    """Blends one joint at a time in plain Python."""
    count, joints, _ = x.shape
    out = np.empty(predicted.shape)
    d, before = d.copy(), before.copy()
    for j in range(joints):
        speak = [s for s in range(count) if w[s, j] > 0]
        old = [s for s in speak if before[s, j]]
        if not speak:
            out[j] = predicted[j]
            before[:, j] = False
            continue
        total = sum(w[s, j] for s in speak)
        mean = sum(w[s, j] * x[s, j] for s in speak) / total
        if old:
            base = sum(w[s, j] * (x[s, j] - d[s, j]) for s in old) / sum(w[s, j] for s in old)
        else:
            base = predicted[j] if known else mean
        for s in speak:
            if not before[s, j]:
                d[s, j] = x[s, j] - base
        out[j] = sum(w[s, j] * (x[s, j] - d[s, j]) for s in speak) / total
        for s in speak:
            d[s, j] += share * (x[s, j] - mean - d[s, j])
        before[:, j] = w[:, j] > 0
    return out, before, d


@settings(deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 4), st.booleans(), st.floats(0, 1), st.sampled_from([3, 4]))
def test_blend_matches_the_slow_reference(seed, count, known, share, width):
    random = np.random.default_rng(seed)
    x, predicted = random.normal(size=(count, 20, width)), random.normal(size=(20, width))
    w = random.uniform(size=(count, 20)) * (random.uniform(size=(count, 20)) > 0.3)
    before, d = random.uniform(size=(count, 20)) > 0.4, random.normal(size=(count, 20, width))
    expected = slow_blend(x, w, predicted, known, before, d, share)
    out = np.empty((20, width))
    blend(x, w, predicted, known, before, d, share, out)
    for actual, wanted in zip((out, before, d), expected, strict=True):
        assert np.allclose(actual, wanted, atol=1e-9)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.integers(2, 4))
def test_joints_do_not_jump_when_weights_change(seed, count):
    """Sensors stand still and contradict each other: weight changes must not move the joint."""
    random = np.random.default_rng(seed)
    x, predicted = random.normal(size=(count, 20, 3)), np.zeros((20, 3))
    before, d = np.zeros((count, 20), bool), np.zeros((count, 20, 3))
    last, out = None, np.empty((20, 3))
    for _ in range(40):
        w = random.uniform(0.01, 1, (count, 20)) * (random.uniform(size=(count, 20)) > 0.2)
        w[0, (w.sum(0) == 0)] = 0.5
        blend(x, w, predicted if last is None else last, last is not None, before, d, 0.05, out)
        if last is not None:
            # At most the low-pass filter's share of the sensors' contradiction shows at once.
            assert np.abs(out - last).max() < 0.05 * 2 * np.abs(x).max() + 1e-9
        last = out.copy()


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_steady_weights_give_the_weighted_mean_without_lag(seed):
    random = np.random.default_rng(seed)
    w = random.uniform(0.1, 1, (3, 20))
    before, d = np.zeros((3, 20), bool), np.zeros((3, 20, 3))
    out = np.empty((20, 3))
    for step in range(200):
        x = random.normal(size=(3, 20, 3))
        blend(x, w, out if step else np.zeros((20, 3)), step > 0, before, d, 0.2, out)
    assert np.allclose(out, (w[..., None] * x).sum(0) / w.sum(0)[:, None], atol=1e-6)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_outlier_weights_match_the_slow_reference(seed):
    random = np.random.default_rng(seed)
    x, predicted = random.normal(size=(3, 20, 3)), random.normal(size=(20, 3))
    w = random.uniform(size=(3, 20)) * (random.uniform(size=(3, 20)) > 0.3)
    expected = w.copy()
    for j in range(20):
        speak = np.flatnonzero(w[:, j])
        if len(speak) > 1:
            apart = ((x[speak, j] - predicted[j]) ** 2).sum(1)
            expected[speak, j] *= (apart.min() + 0.01) / (apart + 0.01)
    doubt_outliers(x, w, predicted)
    assert np.allclose(w, expected)


def test_distances_and_sides_match_the_slow_reference():
    random = np.random.default_rng(1)
    a, b = random.normal(size=(3, 20, 3)), random.normal(size=(2, 20, 3))
    sa, sb = random.uniform(size=(3, 20)), random.uniform(size=(2, 20))
    out = np.empty((3, 2))
    trunk_distances(a, sa, b, sb, MIDLINE_JOINTS, out)
    for m in range(3):
        for n in range(2):
            weights = midline_weights(sa[m]) * midline_weights(sb[n]) + 1e-3
            distances = np.linalg.norm(midline_points(a[m]) - midline_points(b[n]), axis=1)
            assert np.isclose(out[m, n], (weights * distances).sum() / weights.sum())
    weights = np.minimum(sa[0], sa[0][OTHER_SIDE])[LATERAL] + 1e-3
    for cost, x in zip(side_costs(a[0], sa[0], b[0], OTHER_SIDE), (a[0], a[0][OTHER_SIDE]), strict=True):
        distances = np.minimum(np.linalg.norm(x - b[0], axis=1), 0.5)[LATERAL]
        assert np.isclose(cost, (weights * distances).sum() / weights.sum())


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_confidence_matches_the_slow_reference(seed):
    random = np.random.default_rng(seed)
    x, joints = 0.1 * random.normal(size=(3, 20, 3)), 0.1 * random.normal(size=(20, 3))
    w = random.uniform(size=(3, 20)) * (random.uniform(size=(3, 20)) > 0.4)
    confidences, out = random.uniform(size=(3, 20)), np.empty(20)
    fuse_confidence(x, w, confidences, joints, out)
    for j in range(20):
        if not w[:, j].any():
            assert out[j] == 0.0
            continue
        share = w[:, j] / w[:, j].sum()
        spread = (share * ((x[:, j] - joints[j]) ** 2).sum(1)).sum()
        sure = max([(share * confidences[:, j]).sum(), *confidences[share > 0.3, j]])
        assert np.isclose(out[j], sure / (1 + spread / 0.12**2))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_bone_lengths_match_the_slow_reference(seed):
    random = np.random.default_rng(seed)
    joints, bones = random.uniform(size=(20, 3)), random.integers(0, 20, (2, 2))
    shortest, longest = random.uniform(0, 0.5, 2), random.uniform(0.4, 1.2, 2)
    lengths = np.linalg.norm(joints[bones[:, 0]] - joints[bones[:, 1]], axis=1)
    expected = bool(((lengths > shortest) & (lengths < longest)).all())
    assert bones_within(joints, bones, shortest, longest) == expected
