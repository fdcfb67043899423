"""What the summary measures, beside a slow obvious twin; and softened mappings."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_bodies import horse, man, meshed, random_motion, webbed

from enliven.document.project import Project
from enliven.mapping.automatic_mapping import automatic, next_best, retarget
from enliven.mapping.quality import BOUND, quality_of, stretches
from enliven.mapping.softening import limb_of, softened
from enliven.modeling.edits import vertices_of

SEEDS = st.integers(0, 10_000)


@settings(max_examples=4, deadline=None)
@given(SEEDS)
def test_stretch_is_that_of_every_edge(seed):
    shape = webbed("horse", horse())
    made = retarget(shape, random_motion(np.random.default_rng(seed), man(), size=0.6))
    edges, got = stretches(made.project, "horse", made.duration)
    listed = {tuple(sorted((f[a], f[a - 1]))) for f in shape.mesh.faces.tolist() for a in range(3)}
    assert {tuple(edge) for edge in edges.tolist()} == listed
    at = vertices_of(made.project, "horse", made.duration)
    for (a, b), stretch in zip(edges, got[-1], strict=True):
        rest = np.linalg.norm(shape.mesh.vertices[a] - shape.mesh.vertices[b])
        assert stretch == pytest.approx(np.linalg.norm(at[a] - at[b]) / rest, rel=1e-4)


def test_at_rest_all_is_well():
    shape = webbed("horse", horse())
    clip = random_motion(np.random.default_rng(0), man(), frames=2, size=0.0)
    quality = quality_of(Project().with_characters(shape), "horse", clip, 1.0)
    assert quality.stretch == pytest.approx(1.0, abs=1e-5)
    assert (quality.sunk, quality.afloat) == pytest.approx((0.0, 0.0), abs=1e-5)
    assert (quality.joints, quality.slide, quality.through, quality.parts) == ((), None, 0.0, ())
    assert "99th percentile" in str(quality)


@settings(max_examples=3, deadline=None)
@given(SEEDS)
def test_what_stretches_is_moved_less_on_both_sides_alike(seed):
    shape, clip = webbed("horse", horse()), random_motion(np.random.default_rng(seed), man(), size=1.2)
    plan = automatic(clip, shape)
    soft = softened(plan, clip, shape)

    def stretch(one):
        made = retarget(shape, clip, replace(one, floor=False))
        return float(np.percentile(stretches(made.project, "horse", made.duration)[1], 99))

    assert stretch(soft) <= max(stretch(plan), BOUND)
    if stretch(plan) > BOUND:
        assert stretch(soft) < stretch(plan)
    weights = {}
    for chain in soft.chains:
        if "whole" not in chain.role:
            weights.setdefault(limb_of(chain), set()).add(chain.weight)
    assert all(len(alike) == 1 and min(alike) >= 0.4 for alike in weights.values())


def test_what_does_not_stretch_is_left_alone():
    shape, clip = meshed("horse", horse()), random_motion(np.random.default_rng(3), man())
    plan = automatic(clip, shape)
    assert softened(plan, clip, shape) == plan


def test_the_next_best_mapping_is_better_or_none():
    shape, clip = webbed("horse", horse()), random_motion(np.random.default_rng(5), man(), size=2.0)
    made = retarget(shape, clip, automatic(clip, shape))
    before = quality_of(made.project, "horse", clip, made.duration).stretch
    how, plan, stretch = next_best(made, shape)
    assert how and stretch < before
    again = retarget(shape, clip, plan)
    _, measured = stretches(again.project, "horse", again.duration)
    assert float(np.percentile(measured, 99)) == pytest.approx(stretch)
    calm = retarget(meshed("horse", horse()), clip)
    assert next_best(calm, meshed("horse", horse())) is None
