"""Measures the cost of live outputs: the packets of a frame, and the frame rate that the edge loses.

The frame has four human characters with 22 bones each. The peer encodes the same VMC messages one by one with
python-osc. The loss compares an edge without outputs and one with all four, in turn on the same depth images
at full speed. One performer possesses the chair. The receivers are sockets of this machine that are not read.
"""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from bench_road import NODES, Reel
from figure import Figure
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import build_msg

from enliven.arrays import Float
from enliven.document import Character, Pose, Skeleton, SkinWeights
from enliven.frames import DepthFrame
from enliven.person import Body
from enliven.person.human_pose import human_of_body
from enliven.rotation import from_rotation_vector, to_matrix
from enliven_edge.network import Outlet
from enliven_edge.outputs import LiveOutputs, open_outputs, outputs_of
from enliven_edge.outputs.humanoid_map import humanoid_map
from enliven_edge.outputs.live_frame import CharacterInfo, LiveFrame
from enliven_edge.outputs.osc_tree import OscOutput
from enliven_edge.outputs.output import LiveOutput
from enliven_edge.outputs.rokoko import RokokoOutput
from enliven_edge.outputs.vmc import VmcOutput, bone_numbers
from enliven_edge.outputs.vrchat import VrchatOutput
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage import Stage, create_actor
from enliven_edge.tracking import Tracker
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.warmup import warm_up_tracking
from enliven_synthesis.sensor.synthetic import SyntheticSensor

FRAMES, ROUNDS = 120, 3
"""Frames of each run of the edge, and runs with and without outputs."""
SCHEMES = ("vmc", "vrchat", "rokoko", "osc")
REPEATS = 200
"""Frames that each output converts."""


def figures() -> Iterator[Figure]:
    """Yields the time per frame of each output, and the loss of the edge's frame rate in percent."""
    frame = four_humans()
    peer, ours = _microseconds(_python_osc, frame), _of_output(VmcOutput(), frame)
    yield Figure("out.vmc_us", ours, "us", "python-osc", peer / ours)
    for name, output in (("vrchat", VrchatOutput()), ("rokoko", RokokoOutput()), ("osc", OscOutput())):
        yield Figure(f"out.{name}_us", _of_output(output, frame), "us")
    packets = VmcOutput().packets(frame)
    yield Figure("out.vmc_bytes", float(sum(map(len, packets))), "bytes")
    yield Figure("out.vmc_packets", float(len(packets)), "packets")
    with SyntheticSensor(width=640, realtime=False) as sensor:
        frames = [sensor.read() for _ in range(FRAMES)]
    warm_up_tracking()
    without, with_all = [], []
    for _ in range(ROUNDS):
        without.append(_frame_rate(frames, ()))
        with_all.append(_frame_rate(frames, SCHEMES))
    yield Figure("out.edge_fps", float(np.median(with_all)), "frames/s")
    loss = 1.0 - np.median(with_all) / np.median(without)
    yield Figure("out.edge_loss_percent", 100.0 * float(loss), "%")


def four_humans() -> LiveFrame:
    """Returns a frame with four human rigs, and the four performers that move them."""
    skeleton, random = _skeleton(), np.random.default_rng(0)
    characters, poses, people = {}, [], {}
    above = np.maximum(skeleton.parents, 0)
    skin = SkinWeights(np.zeros((3, 4), np.uint16), np.tile(np.float32([1, 0, 0, 0]), (3, 1)))
    triangle, edges = np.eye(3, dtype=np.float32), np.zeros((0, 2), np.int32)
    humanoid = humanoid_map(skeleton)
    assert humanoid is not None
    for number in range(1, 5):
        name = f"human {number}"
        pivots = skeleton.positions[above].astype(np.float32)
        rig = Character(
            *(name, triangle, np.array([[0, 1, 2]], np.int32), skin, pivots, edges, "bones"),
            names=skeleton.names,
        )
        characters[name] = CharacterInfo(rig, humanoid)
        turns = to_matrix(from_rotation_vector(random.uniform(-0.5, 0.5, (len(skeleton), 3))))
        poses.append(Pose(name, 0, turns.astype(np.float32), pivots + np.float32(number)))
        people[number] = _standing(number, np.array([number - 2.5, 0.95, -3.0]))
    return LiveFrame(0, people, poses, characters)


def _standing(number: int, place: Float) -> Body:
    """Returns a performer that stands upright."""
    posture = Posture(place, np.tile(np.eye(3), (13, 1, 1)), model.lengths_for_height(1.75))
    return Body(number, posture.joints(), np.ones(20), posture.orientations(), np.ones(2), 1.75)


def _skeleton() -> Skeleton:
    """Returns the bones of a performer as a rig with their names in VRM."""
    human = human_of_body(_standing(1, np.array([0.0, 0.95, 0.0])), "")
    names = tuple(bone[0].lower() + bone[1:] for bone in human.bones)
    return Skeleton(names, human.parents.astype(np.int32), human.positions)


def _microseconds(convert: Callable[[LiveFrame], object], frame: LiveFrame) -> float:
    """Returns the median time per frame. Each call gets a new frame, so that nothing is computed before."""
    convert(replace(frame, _humans={}))
    took = []
    for _ in range(REPEATS):
        fresh = replace(frame, _humans={})
        begin = time.perf_counter()
        convert(fresh)
        took.append(time.perf_counter() - begin)
    return 1e6 * float(np.median(took))


def _of_output(output: LiveOutput, frame: LiveFrame) -> float:
    return _microseconds(output.packets, frame)


def _python_osc(frame: LiveFrame) -> bytes:
    """Encodes the bones of one human and the trackers of three, one by one with python-osc."""
    builder = OscBundleBuilder(IMMEDIATELY)
    first, *others = (frame.human_character(name) for name in frame.characters)
    for bone, numbers in zip(first.bones, bone_numbers(first).tolist(), strict=True):
        builder.add_content(build_msg("/VMC/Ext/Bone/Pos", [bone, *numbers]))
    for human in others:
        for bone, numbers in zip(human.bones, bone_numbers(human).tolist(), strict=True):
            builder.add_content(build_msg("/VMC/Ext/Tra/Pos", [f"{human.name}/{bone}", *numbers]))
    return builder.build().dgram


def _frame_rate(frames: list[DepthFrame], schemes: tuple[str, ...]) -> float:
    """Returns the frames per second of an edge with these outputs, after the performer was found."""
    actor = create_actor("chair", nodes=NODES)
    actor.warm_up()
    with contextlib.ExitStack() as stack:
        words = []
        for scheme in schemes:
            receiver = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            receiver.bind(("127.0.0.1", 0))
            words.append(f"{scheme}:127.0.0.1:{receiver.getsockname()[1]}")
        outputs: LiveOutputs = stack.enter_context(open_outputs(outputs_of(words, {})))
        outlet = stack.enter_context(Outlet(WireSettings(name="bench", port=0, control_port=0), "reel"))
        edge = Edge(Reel(frames), Tracker(), Stage([actor]), outlet, outputs=outputs)
        begin = 0.0
        for number, frame in enumerate(frames):
            if number == FRAMES // 4:
                edge.stage.possess("chair")
                begin = time.perf_counter()
            edge.step(frame)
            edge._poll_requests()
        return (FRAMES - FRAMES // 4) / (time.perf_counter() - begin)
