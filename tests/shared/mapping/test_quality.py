"""Tests of the measures in the summary against a slow reference, and of softened mappings."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_bodies import horse, man, random_motion, shape_with_joint_bands, shape_with_markers, walk

from enliven.document.project import Project
from enliven.mapping.alternatives import find_better_mapping
from enliven.mapping.automatic_mapping import create_automatic_plan, retarget
from enliven.mapping.quality import (
    MAX_FLOOR_DISTANCE,
    MAX_SLIDE_CM_S,
    MAX_STRETCH,
    measure_quality,
    stretch_over_time,
)
from enliven.mapping.softening import limb_name, soften_plan
from enliven.modeling.edits import compute_vertices

SEEDS = st.integers(0, 10_000)


@settings(max_examples=4, deadline=None)
@given(SEEDS)
def test_stretch_is_that_of_every_edge(seed):
    shape = shape_with_joint_bands("horse", horse())
    result = retarget(shape, random_motion(np.random.default_rng(seed), man(), size=0.6))
    edges, ratios = stretch_over_time(result.project, "horse", result.duration)
    listed = {tuple(sorted((f[a], f[a - 1]))) for f in shape.mesh.faces.tolist() for a in range(3)}
    assert {tuple(edge) for edge in edges.tolist()} == listed
    at = compute_vertices(result.project, "horse", result.duration)
    for (a, b), stretch in zip(edges, ratios[-1], strict=True):
        rest = np.linalg.norm(shape.mesh.vertices[a] - shape.mesh.vertices[b])
        assert stretch == pytest.approx(np.linalg.norm(at[a] - at[b]) / rest, rel=1e-4)


def test_rest_pose_has_no_deformation():
    shape = shape_with_joint_bands("horse", horse())
    clip = random_motion(np.random.default_rng(0), man(), frames=2, size=0.0)
    quality = measure_quality(Project().with_characters(shape), "horse", clip, 1.0)
    assert quality.stretch == pytest.approx(1.0, abs=1e-5)
    assert (quality.sunk, quality.afloat) == pytest.approx((0.0, 0.0), abs=1e-5)
    assert (quality.joints, quality.slide, quality.through, quality.parts) == ((), None, 0.0, ())
    assert "99th percentile" in str(quality)


@settings(max_examples=3, deadline=None)
@given(SEEDS)
@pytest.mark.slow
def test_what_stretches_is_moved_less_on_both_sides_alike(seed):
    shape, clip = (
        shape_with_joint_bands("horse", horse()),
        random_motion(np.random.default_rng(seed), man(), size=1.2),
    )
    plan = create_automatic_plan(clip, shape)
    soft = soften_plan(plan, clip, shape)

    def stretch(one):
        result = retarget(shape, clip, replace(one, floor=False))
        return float(np.percentile(stretch_over_time(result.project, "horse", result.duration)[1], 99))

    assert stretch(soft) <= max(stretch(plan), MAX_STRETCH)
    if stretch(plan) > MAX_STRETCH:
        assert stretch(soft) < stretch(plan)
    weights = {}
    for chain in soft.chains:
        if "whole" not in chain.role:
            weights.setdefault(limb_name(chain), set()).add(chain.weight)
    assert all(len(pair) == 1 and min(pair) >= 0.4 for pair in weights.values())


def test_what_does_not_stretch_is_left_alone():
    shape, clip = shape_with_markers("horse", horse()), random_motion(np.random.default_rng(3), man())
    plan = create_automatic_plan(clip, shape)
    assert soften_plan(plan, clip, shape) == plan


@pytest.mark.slow
def test_suggested_mapping_is_better_or_missing():
    shape, clip = (
        shape_with_joint_bands("horse", horse()),
        random_motion(np.random.default_rng(5), man(), size=2.0),
    )
    result = retarget(shape, clip, create_automatic_plan(clip, shape))
    before = measure_quality(result.project, "horse", clip, result.duration)
    other = find_better_mapping(result, shape, before)
    assert other.how and other.quality.faults < before.faults and other.quality.stretch < before.stretch
    other_result = retarget(shape, clip, other.plan)
    assert measure_quality(other_result.project, "horse", clip, other_result.duration) == other.quality
    calm, clip = shape_with_markers("horse", horse()), walk()
    result = retarget(calm, clip)
    assert (
        find_better_mapping(result, calm, measure_quality(result.project, "horse", clip, result.duration))
        is None
    )


@pytest.mark.slow
def test_the_next_best_mapping_is_judged_by_floor_and_slide_and_not_by_stretch_alone():
    """The feet of a horse leave the floor. Less movement would stretch the surface least, but worsen the
    result.
    """
    shape, clip = shape_with_joint_bands("horse", horse()), walk(raised=1.5)
    plan = replace(create_automatic_plan(clip, shape), travel=True, steps=False, floor=False)
    result = retarget(shape, clip, plan)
    before = measure_quality(result.project, "horse", clip, result.duration)
    assert before.sunk > MAX_FLOOR_DISTANCE and before.slide > MAX_SLIDE_CM_S and before.feet
    other = find_better_mapping(result, shape, before)
    assert other.plan == replace(plan, floor=True) and other.how == "with --floor"
    assert other.quality.sunk < MAX_FLOOR_DISTANCE and other.quality.slide < MAX_SLIDE_CM_S
    less = tuple(c if "whole" in c.role else replace(c, weight=0.6) for c in plan.chains)
    still = retarget(shape, clip, replace(plan, chains=less))
    least = measure_quality(still.project, "horse", clip, still.duration)
    assert least.stretch < other.quality.stretch and least.faults > before.faults


def test_feet_in_place_do_not_slide():
    """Walking in place is like walking on a treadmill, and no fault of a mapping."""
    shape, clip = shape_with_markers("man", man()), walk()
    slides = []
    for travel in (False, True):
        result = retarget(shape, clip, replace(create_automatic_plan(clip, shape), travel=travel))
        slides.append(measure_quality(result.project, "man", clip, result.duration).slide)
    assert slides[0] is None and slides[1] < 2.0
