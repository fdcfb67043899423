"""Tests of the time map of layers: all rigs share one definition, and the compiled form computes the same."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_lanes import lanes, lengths, maps, sixteenths

from enliven.document import GraphPart
from enliven.document.clip import Clip
from enliven.document.layers import Layer
from enliven.document.naming import unused
from enliven.document.puppet import PuppetLayer
from enliven.document.skeleton import Skeleton
from enliven.errors import InputError
from enliven.motion.layers.timing import LayerClocks

laws = settings(deadline=None, max_examples=100)


def obvious(layer, time, length):
    """Returns the frame time, computed by moving along the take and jumping to the other end whenever an end
    is reached.
    """
    hand = Fraction(time) - Fraction(layer.offset)
    hand *= Fraction(layer.speed)
    if layer.speed < 0:
        hand += Fraction(length)
    rounds = 0
    while layer.loop and hand >= length:
        hand, rounds = hand - Fraction(length), rounds + 1
    while layer.loop and hand < 0:
        hand, rounds = hand + Fraction(length), rounds - 1
    return float(min(max(hand, Fraction(0)), Fraction(length))), rounds


@laws
@given(maps, sixteenths, lengths)
def test_playback_matches_scrubbing_over_the_take(layer, time, length):
    assert layer.find_played_time(time, length) == obvious(layer, time, length)


@laws
@given(maps, sixteenths, sixteenths, lengths)
def test_a_layer_that_begins_later_plays_the_same_later(layer, time, delay, length):
    assert layer.add_delay(delay).find_played_time(time + delay, length) == layer.find_played_time(
        time, length
    )


@laws
@given(maps, lengths, st.integers(0, 16))
def test_inverse_time_map_matches_playback(layer, length, share):
    second = length * share / 16
    time = layer.time_of(second, length)
    played, rounds = layer.find_played_time(time, length)
    # The two ends of a loop are one moment.
    assert played + rounds * length == second and rounds in ((0, 1) if layer.loop else (0,))
    assert layer.offset <= time <= layer.end(length) == layer.offset + layer.compute_loop_duration(length)


@laws
@given(st.lists(lanes(), min_size=1, max_size=4), st.lists(sixteenths, min_size=1, max_size=5), lengths)
def test_the_compiled_form_plays_the_same(layers, times, length):
    frames = round(length * 16) + 1
    skeleton = Skeleton(("a", "b"), [-1, 0], [[0, 0, 0], [1.0, 0, 0]])
    clip = Clip("take", skeleton, np.tile([1.0, 0, 0, 0], (frames, 2, 1)), np.zeros((frames, 3)), 1 / 16)
    played = LayerClocks.from_layers(layers, [clip] * len(layers)).frames_at(np.array(times))
    for t, time in enumerate(times):
        for k, layer in enumerate(layers):
            moment = layer.moment(time, length)
            seconds = [played.frame[t, k] / 16, played.other[t, k] / 16]
            assert seconds == pytest.approx([moment.second, moment.other], abs=1e-12)
            assert played.rounds[t, k] == moment.rounds
            rest = [played.share[t, k], played.weight[t, k]]
            assert rest == pytest.approx([moment.share, moment.weight], abs=1e-12)


@pytest.mark.parametrize(
    "make",
    [
        lambda **time: Layer("layer", "take", (0,), **time),
        lambda **time: GraphPart("take", np.arange(2), **time),
        lambda **time: PuppetLayer("take", **time),
    ],
)
def test_the_layers_of_all_rigs_are_time_maps(make):
    assert make(offset=1.0, speed=-2.0, loop=True).find_played_time(1.25, 3.0) == (2.5, 0)
    for wrong in ({"speed": 0.0}, {"speed": np.nan}, {"offset": np.inf}):
        with pytest.raises(InputError, match="is not valid"):
            make(**wrong)


def test_names_count_on_from_the_number_that_they_have():
    assert unused("part", {}) == "part"
    assert unused("part", {"part", "part 2"}) == "part 3"
    assert unused("part 2", {"part", "part 2"}) == "part 3"
    assert unused("part 2", {"part 2", "part 3"}) == "part 4"
    assert unused("part 1", {"part 1"}) == "part 1 2", "the first of some parts stays the first"
    assert unused("2", {"2"}) == "2 2"
    assert unused("take-2", {"take-2"}, "-") == "take-3"
