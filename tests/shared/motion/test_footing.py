"""Tests of foot locking per clip: "never" changes nothing, "always" prevents sliding, "ground" prevents
sinking.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_pin import FEET as ANKLES
from test_pin import walk, walking

from enliven.document import FEET, Segment, are_identical
from enliven.errors import InputError
from enliven.formats.project.file import parse_project, project_bytes
from enliven.modeling.edits import change_layers, lock_feet
from enliven.motion.contact.pin import pin_feet, resolve_pins
from enliven.motion.layers.evaluate import Player
from enliven.motion.layers.footing import foot_modes

laws = settings(deadline=None, max_examples=12)
slides = st.floats(-0.4, 0.4)
TIMES = np.arange(0.0, 3.0, 1 / 90)


def world(slide, feet, low=0.0):
    project = pin_feet(walking(walk(slide=slide)), "walker", ANKLES)
    shape = project.shape("walker")
    project = project.with_characters(shape.with_changes(place=[0.0, -low, 0.0]))
    return lock_feet(project, "walker", range(len(shape.layers)), feet)


def ankles(project):
    shape = project.shape("walker")
    return [shape.skeleton.index(name) for name in ANKLES]


@laws
@given(slides)
def test_never_changes_nothing(slide):
    player = Player(world(slide, "never"), "walker")
    for held, free in zip(player.sample(TIMES), player.sample_unpinned(TIMES), strict=True):
        np.testing.assert_allclose(held, free, atol=1e-9)


@laws
@given(slides, st.floats(-0.15, 0.15))
def test_always_lets_no_foot_slide_while_it_stands(slide, low):
    project = world(slide, "always", low)
    player = Player(project, "walker")
    joints, stands = player.sample(TIMES)[1], 0
    for name, ankle in zip(ANKLES, ankles(project), strict=True):
        seen = player.contacts()[name]
        assert len(seen.starts) > 2
        for start, end in zip(seen.starts, seen.ends, strict=True):
            inside = (start <= TIMES) & (end >= TIMES)
            stands += inside.sum()
            if inside.any():
                assert np.ptp(joints[inside][:, ankle][:, [0, 2]], axis=0).max() < 1e-3
    assert stands > 0.5 * len(TIMES), "on one foot or the other, most of the time"


@laws
@given(slides, st.floats(0.0, 0.3))
def test_grounding_lets_no_foot_below_the_floor_and_leaves_those_above(slide, low):
    project = world(slide, "ground", low)
    player = Player(project, "walker")
    held, free = player.sample(TIMES)[1], player.sample_unpinned(TIMES)[1]
    for pin in resolve_pins(project.shape("walker")):
        lowest = free[:, pin.below, 1].min(1)
        assert held[:, pin.below, 1].min() >= pin.sole - 1e-6
        above = lowest >= pin.sole
        np.testing.assert_allclose(held[above][:, pin.below], free[above][:, pin.below], atol=1e-12)
        over = [0, 2]
        np.testing.assert_allclose(
            held[:, pin.chain[-1]][:, over], free[:, pin.chain[-1]][:, over], atol=1e-3
        )


@laws
@given(slides, st.sampled_from(FEET[1:]), st.sampled_from(FEET[1:]))
def test_each_clip_has_its_own_way(slide, first, second):
    """Two layers that play one after the other on the legs: each decides while it is heard."""
    project = world(slide, "auto")
    shape = project.shape("walker")
    half = (Segment(0.0, 1.5), Segment(1.6, 3.0, 1.6))
    project = change_layers(project, "walker", range(2), segments=half[:1], hold=False, feet=first)
    late = [
        type(layer)(
            f"{layer.id} late", layer.take, layer.chain, layer.basis, offset=1.6, hold=False, feet=second
        )
        for layer in shape.layers
    ]
    spans = [
        tuple(
            type(span)(
                span.share,
                (*span.refs, *(type(ref)(f"{ref.layer} late", ref.start, ref.end) for ref in span.refs)),
            )
            for span in bone
        )
        for bone in shape.spans
    ]
    shape = project.shape("walker")
    project = project.with_characters(shape.with_changes(spans=spans, layers=(*shape.layers, *late)))
    shape = project.shape("walker")
    modes = foot_modes(project, shape, resolve_pins(shape))
    assert modes is not None
    modes_at = modes(np.array([0.5, 1.0, 2.0, 2.5]))
    assert (modes_at[:, :2] == FEET.index(first)).all() and (modes_at[:, 2:] == FEET.index(second)).all()
    assert are_identical(parse_project(project_bytes(project)), project), "kept in the file"


def test_automatic_footing_sets_no_modes():
    project = world(0.2, "auto")
    shape = project.shape("walker")
    assert foot_modes(project, shape, resolve_pins(shape)) is None


def test_feet_are_found_and_unknown_modes_are_refused():
    project = walking(walk())
    locked = lock_feet(project, "walker", [0, 1], "always")
    assert {pin.joint for pin in locked.shape("walker").pins} == set(ANKLES)
    assert not lock_feet(project, "walker", [0], "auto").shape("walker").pins
    with pytest.raises(InputError, match="the foot lock mode 'sometimes' does not exist"):
        lock_feet(project, "walker", [0], "sometimes")
