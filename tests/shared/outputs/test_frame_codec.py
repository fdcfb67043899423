"""Tests that a frame sent to another process gives the same packets as the original."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from live_scenes import four_characters

from enliven.camera import Intrinsics
from enliven.frames import DepthFrame
from enliven.outputs.depth_memory import DepthMemory
from enliven.outputs.live_frame import LiveEvent, LiveFrame
from enliven.outputs.osc_tree import OscOutput
from enliven.outputs.process.frame_codec import FrameDecoder, FrameEncoder
from enliven.outputs.rokoko import RokokoOutput
from enliven.outputs.vmc import VmcOutput
from enliven.outputs.vrchat import VrchatOutput


def handed_over(encoder: FrameEncoder, decoder: FrameDecoder, frame: LiveFrame) -> LiveFrame:
    return decoder.decode(pickle.loads(pickle.dumps(encoder.encode(frame, None))))


@pytest.mark.parametrize("kind", [VmcOutput, VrchatOutput, RokokoOutput, OscOutput])
def test_packets_of_a_copy_are_equal(kind):
    encoder, decoder = FrameEncoder(), FrameDecoder(lambda reference: None)
    direct, distant = kind(), kind()
    events = [LiveEvent("possess", 1, "chair"), LiveEvent("leave", 2)]
    for step in range(3):
        frame = replace(four_characters(), time_ns=10**9 + step * 10**8, events=events)
        some = {name: info for name, info in frame.characters.items() if step != 1 or name != "ben"}
        poses = [pose for pose in frame.poses if pose.character in some]
        frame = replace(frame, characters=some, poses=poses, held=frozenset(["anna"]), mirrored=True)
        copy = handed_over(encoder, decoder, frame)
        assert distant.encode_packets(copy) == direct.encode_packets(frame)
        assert (copy.held, copy.mirrored, list(copy.characters)) == (frame.held, True, list(some))


def test_unchanged_characters_are_sent_once():
    frame, encoder = four_characters(), FrameEncoder()
    first, second = (len(pickle.dumps(encoder.encode(frame, None))) for _ in range(2))
    assert second < first / 2
    new = dict(frame.characters)
    new["anna"] = replace(new["anna"])
    assert second < len(pickle.dumps(encoder.encode(replace(frame, characters=new), None))) < first


def test_an_overwritten_depth_image_is_left_out():
    camera = Intrinsics(8, 6, 7.0, 7.5, 3.0, 2.5)
    with DepthMemory() as memory:
        images = [DepthFrame(np.full((6, 8), k, np.uint16), camera, k, "made") for k in range(1, 5)]
        first, *later = [memory.write(image) for image in images]
        assert memory.read(first) is None
        for reference, image in zip(later, images[1:], strict=True):
            copy = memory.read(reference)
            assert np.array_equal(copy.depth, image.depth) and copy.time_ns == image.time_ns
        large = Intrinsics(4096, 2160, 1.0, 1.0, 0.0, 0.0)
        assert memory.write(DepthFrame(np.zeros((2160, 4096), np.uint16), large, 0, "made")) is None
