"""Tests of weights and speeds as curves over time: one key is a constant, and time never decreases."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from rig_worlds import WORLDS, kind
from test_character_laws import near

from enliven.document import (
    EASES,
    MAX_SPEED,
    MIN_SPEED,
    CurveKey,
    GraphPart,
    Layer,
    are_identical,
    curve_from_keys,
)
from enliven.errors import InputError
from enliven.exporters import sample_performance
from enliven.formats.project.file import parse_project, project_bytes
from enliven.modeling.edits import (
    change_layers,
    compute_vertices,
    find_layer_clips,
    layer_keys,
    move_layer_key,
    remove_layer_key,
    set_layer_key,
    shift_character,
    split_clip,
    stretch_clip,
    trim_clip,
)
from enliven.motion.layers.timing import LayerClocks

laws = settings(deadline=None, max_examples=8)
RIGS = ("bones", "graph", "points", "cage", "keyed bones", "keyed graph")
worlds = pytest.mark.parametrize("rig", RIGS)
times = st.floats(-0.5, 3.0)
speeds = st.lists(
    st.tuples(st.integers(0, 40), st.floats(0.1, 4.0), st.sampled_from(EASES)),
    min_size=1,
    max_size=4,
    unique_by=lambda one: one[0],
).map(lambda keys: tuple(CurveKey(f / 20, v, e) for f, v, e in sorted(keys)))
shares = st.lists(
    st.tuples(st.integers(0, 40), st.floats(0.0, 1.0), st.sampled_from(EASES)),
    min_size=1,
    max_size=4,
    unique_by=lambda one: one[0],
).map(lambda keys: tuple(CurveKey(f / 20, v, e) for f, v, e in sorted(keys)))


def all_of(project, name):
    return range(len(project.character(name).playing))


@worlds
@laws
@given(st.floats(0, 1), times, times)
def test_a_weight_of_one_key_is_the_number(rig, weight, at, time):
    project, name = WORLDS[rig]
    for number, layer in enumerate(project.character(name).playing):
        curved = set_layer_key(project, name, [number], "weights", at, weight)
        if hasattr(layer, "weight"):
            plain = change_layers(project, name, [number], weight=weight * layer.weight)
            near(compute_vertices(curved, name, time), compute_vertices(plain, name, time))
        silent = set_layer_key(project, name, [number], "weights", at, 0.0)
        muted = change_layers(project, name, [number], muted=True)
        if not (isinstance(layer, Layer) and project.shape(name).travel == layer.id):
            near(compute_vertices(silent, name, time), compute_vertices(muted, name, time))
        assert are_identical(remove_layer_key(curved, name, [number], "weights", 0), project)


@worlds
@laws
@given(st.floats(0.1, 4.0), times, times)
def test_a_speed_of_one_key_is_the_number(rig, speed, at, time):
    project, name = WORLDS[rig]
    project = change_layers(project, name, all_of(project, name), loop=False)
    for number, layer in enumerate(project.character(name).playing):
        curved = set_layer_key(project, name, [number], "speeds", at, speed)
        plain = change_layers(project, name, [number], speed=speed * layer.speed)
        near(compute_vertices(curved, name, time), compute_vertices(plain, name, time))
        curved_layer, other = (each.character(name).playing[number] for each in (curved, plain))
        length = project.length_of(layer)
        assert curved_layer.end(length) == pytest.approx(other.end(length))
        clip, wanted = curved_layer.clips(length)[0], other.clips(length)[0]
        assert (clip.begin, clip.end, clip.speed) == pytest.approx((wanted.begin, wanted.end, wanted.speed))


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(speeds, st.lists(st.floats(-2, 4), min_size=2, max_size=5), st.floats(-1, 1))
def test_time_rises_as_the_sum_of_its_speeds_and_is_found_again(keys, moments, offset):
    layer = GraphPart("take", np.arange(1), offset=offset, speeds=keys)
    moments = sorted(moments)
    even = [layer.convert_to_unwarped_time(time) for time in moments]
    assert (np.diff(even) >= MIN_SPEED * np.diff(moments) - 1e-9).all()
    for time, at in zip(moments, even, strict=True):
        assert layer.convert_to_warped_time(at) == pytest.approx(time, abs=1e-6)
        fine = np.linspace(0, time - offset, 4001)
        rows = curve_from_keys(keys)((fine[1:] + fine[:-1]) / 2)  # the slow twin: a sum of thin slices
        # A step within a slice is off by that slice at most.
        assert at - offset == pytest.approx(rows.mean() * (time - offset), abs=4 * 6 * 4.0 / 4000)
    assert layer.convert_to_unwarped_time(offset) == pytest.approx(offset)


@settings(deadline=None, max_examples=25)
@given(speeds, shares, st.floats(-2, 4), st.booleans(), st.booleans())
def test_compiled_they_are_the_same(fast, weights, time, loop, back):
    project, name = WORLDS["bones"]
    layer = project.shape(name).layers[0]
    layer = replace(layer, speeds=fast, weights=weights, loop=loop, speed=-1.0 if back else 0.7)
    clip = project.takes[layer.take]
    clocks, moment = LayerClocks.from_layers([layer], [clip]), layer.moment(time, clip.duration)
    assume(min(abs(moment.second), abs(moment.second - clip.duration)) > 1e-6 or not loop)
    played = clocks.frames_at(np.array([time]))
    assert played.frame[0, 0] * clip.step == pytest.approx(moment.second, abs=1e-9)
    assert played.rounds[0, 0] == moment.rounds
    heard = played.weight[0, 0] * clocks.weight_curves(np.array([time]))[0, 0]
    assert heard == pytest.approx(moment.weight, abs=1e-12)


@worlds
@laws
@given(speeds, shares, times, st.floats(0.15, 0.85))
@pytest.mark.slow
def test_clips_are_split_trimmed_and_shifted_under_curves(rig, fast, weights, time, share):
    project, name = WORLDS[rig]
    count = len(project.character(name).playing)
    for number in range(count):
        changes = {"loop": False, "speeds": fast, "weights": weights}
        curved = change_layers(project, name, [number], **changes)
        (clip,) = find_layer_clips(curved, name, number)
        at = clip.begin + share * (clip.end - clip.begin)
        split = split_clip(curved, name, [number], at)
        near(compute_vertices(split, name, time), compute_vertices(curved, name, time), 1e-5)
        assert find_layer_clips(split, name, number)[0].end == pytest.approx(at, abs=1e-6)
        trimmed = trim_clip(curved, name, [number], 0, begin=at)
        later = max(time, at + 1e-3)
        near(compute_vertices(trimmed, name, later), compute_vertices(curved, name, later), 1e-5)
        slower = stretch_clip(curved, name, [number], 0, end=clip.end + 0.5)
        assert find_layer_clips(slower, name, number)[0].end == pytest.approx(clip.end + 0.5, abs=1e-5)
        assert are_identical(parse_project(project_bytes(curved)), curved)
        late = shift_character(curved, name, 0.5)
        near(compute_vertices(late, name, time + 0.5), compute_vertices(curved, name, time))


@worlds
def test_export_matches_displayed_motion(rig):
    project, name = WORLDS[rig]
    numbers = all_of(project, name)
    for number in numbers:
        project = set_layer_key(project, name, [number], "speeds", 0.2, 2.0, "linear")
        project = set_layer_key(project, name, [number], "speeds", 0.8, 0.5)
        project = set_layer_key(project, name, [number], "weights", 0.0, 1.0)
        project = set_layer_key(project, name, [number], "weights", 0.9, 0.3)
    performance = sample_performance(project, name, 0.0, 0.6, 10.0)
    pose = list(performance.poses())[-1]
    skin, mesh = performance.skin, performance.mesh
    arms = mesh.vertices[:, None] - performance.pivots[skin.indices]
    moved = np.einsum("vkij,vkj->vki", pose.linear[skin.indices].astype(float), arms)
    exported = ((moved + pose.positions[skin.indices]) * skin.weights[..., None]).sum(1)
    # A puppet is baked with its own error.
    near(exported, compute_vertices(project, name, 0.6), 0.05 if kind(rig) == "points" else 1e-5)


def test_keys_are_moved_eased_and_refused():
    project, name = WORLDS["bones"]
    project = set_layer_key(project, name, [0, 1], "weights", 0.5, 0.2)
    project = set_layer_key(project, name, [0, 1], "weights", 1.5, 0.8)
    moved = move_layer_key(project, name, [0, 1], "weights", 0, 1.0, 0.4, "linear")
    offsets = [layer.offset for layer in moved.shape(name).layers[:2]]
    for number, offset in enumerate(offsets):
        first = layer_keys(moved, name, number, "weights")[0]
        assert (first.second + offset, first.value, first.ease) == (pytest.approx(1.0), 0.4, "linear")
    for wrong, words in (
        (lambda: set_layer_key(project, name, [0], "speeds", 0.5, 0.0), "speed to values"),
        (lambda: set_layer_key(project, name, [0], "speeds", 0.5, -1.0), "speed to values"),
        (lambda: set_layer_key(project, name, [0], "speeds", 0.5, 2 * MAX_SPEED), "speed to values"),
        (lambda: set_layer_key(project, name, [0], "weights", 0.5, 1.5), "sets the layer's weight to 1.5"),
        (lambda: set_layer_key(project, name, [0], "weights", np.nan, 0.5), "is not valid"),
        (lambda: set_layer_key(project, name, [99], "weights", 0.5, 0.5), "no layer 99"),
        (lambda: move_layer_key(project, name, [0], "weights", 0, 1.5), "at the same time"),
        (lambda: remove_layer_key(project, name, [0], "speeds", 0), "the curve of the speeds has no key 0"),
    ):
        with pytest.raises(InputError, match=words):
            wrong()
