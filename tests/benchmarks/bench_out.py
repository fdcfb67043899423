"""Measures the cost of live outputs: the packets of a frame, and the time that the edge loses.

The frame has four human characters with 22 bones each. The peer encodes the same VMC messages one by one with
python-osc. The loss compares an edge without outputs and one with all five, in turn on the same depth
images. At the rates of cameras, it is the share of the camera's frames that the edge skips because it is
late. At full speed ("unpaced"), it is the share of the edge's frame rate. The share is the processor time of
the handover, divided by that of the whole frame. One performer possesses the chair. The receivers are sockets
of this machine that are not read. That of Foxglove has subscribed to everything.
"""

from __future__ import annotations

import contextlib
import json
import math
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from bench_road import NODES, Reel
from figure import Figure
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import build_msg
from websockets import Subprotocol
from websockets.sync.client import ClientConnection, connect

from enliven.arrays import Float
from enliven.document import Character, Pose, Skeleton, SkinWeights
from enliven.frames import DepthFrame
from enliven.outputs.foxglove.stage_encoders import SceneEncoder, StageEncoder, TransformsEncoder
from enliven.outputs.humanoid_map import humanoid_map
from enliven.outputs.live_frame import CharacterInfo, LiveFrame
from enliven.outputs.opening import open_outputs
from enliven.outputs.osc_tree import OscOutput
from enliven.outputs.output import LiveOutput
from enliven.outputs.rokoko import RokokoOutput
from enliven.outputs.settings import collect_output_settings
from enliven.outputs.vmc import VmcOutput
from enliven.outputs.vrchat import VrchatOutput
from enliven.person import Body, HumanPose, unity_position, unity_rotation
from enliven.person.human_pose import human_of_body
from enliven.rotation import from_rotation_vector, to_matrix
from enliven_edge.live_outputs import LiveOutputs
from enliven_edge.network.outlet import Outlet
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.character_setup import create_actor
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.tracker import Tracker
from enliven_edge.warmup import warm_up_tracking
from enliven_synthesis.sensor.synthetic import SyntheticSensor

FRAMES, ROUNDS = 120, 3
"""Frames of each run of the edge, and runs with and without outputs."""
CAMERA_FPS = (30.0, 60.0)
"""Frames per second of the usual cameras, and of their fast modes."""
SCHEMES = ("vmc", "vrchat", "rokoko", "osc", "foxglove")
REPEATS = 200
"""Number of frames that each output converts."""


def figures() -> Iterator[Figure]:
    """Yields the time per frame of each output, and the loss of the edge's frame rate in percent."""
    frame = make_four_humans()
    peer, ours = _microseconds(_python_osc, frame), _measure_output(VmcOutput(), frame)
    yield Figure("out.vmc_us", ours, "us", "python-osc", peer / ours)
    for name, output in (("vrchat", VrchatOutput()), ("rokoko", RokokoOutput()), ("osc", OscOutput())):
        yield Figure(f"out.{name}_us", _measure_output(output, frame), "us")
    yield Figure("out.foxglove_us", _microseconds(_foxglove(), frame), "us")
    packets = VmcOutput().encode_packets(frame)
    yield Figure("out.vmc_bytes", float(sum(map(len, packets))), "bytes")
    yield Figure("out.vmc_packets", float(len(packets)), "packets")
    with SyntheticSensor(width=640, realtime=False) as sensor:
        frames = [sensor.read() for _ in range(FRAMES)]
    warm_up_tracking()
    for rate in (*CAMERA_FPS, math.inf):
        yield from _edge_figures(frames, rate)


def _edge_figures(frames: list[DepthFrame], rate: float) -> Iterator[Figure]:
    """Yields the cost of all outputs for an edge with a camera of this rate."""
    without, with_all = [], []
    for _ in range(ROUNDS):
        without.append(_step_seconds(frames, (), rate))
        with_all.append(_step_seconds(frames, SCHEMES, rate))
    before, after = (np.concatenate(rounds) for rounds in (without, with_all))
    name = "unpaced" if math.isinf(rate) else f"{rate:.0f}hz"
    yield Figure(f"out.edge_{name}_share_percent", _share_percent(frames, rate), "%")
    yield Figure(f"out.edge_{name}_step_ms", 1e3 * float(np.median(after)), "ms")
    yield Figure(f"out.edge_{name}_step_p99_ms", 1e3 * float(np.percentile(after, 99)), "ms")
    # At full speed, the edge skips no frames, so compare the numbers of frames in the same time.
    kept = before.mean() / after.mean() if math.isinf(rate) else len(after) / len(before)
    yield Figure(f"out.edge_{name}_loss_percent", 100.0 * (1.0 - float(kept)), "%")


def make_four_humans() -> LiveFrame:
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
        people[number] = _make_standing(number, np.array([number - 2.5, 0.95, -3.0]))
    return LiveFrame(0, people, poses, characters)


def _make_standing(number: int, place: Float) -> Body:
    """Returns a performer that stands upright."""
    posture = Posture(place, np.tile(np.eye(3), (13, 1, 1)), model.lengths_for_height(1.75))
    return Body(number, posture.joints(), np.ones(20), posture.orientations(), np.ones(2), 1.75)


def _skeleton() -> Skeleton:
    """Returns the bones of a performer as a rig with VRM bone names."""
    human = human_of_body(_make_standing(1, np.array([0.0, 0.95, 0.0])), "")
    names = tuple(bone[0].lower() + bone[1:] for bone in human.bones)
    return Skeleton(names, human.parents.astype(np.int32), human.positions)


def _microseconds(convert: Callable[[LiveFrame], object], frame: LiveFrame) -> float:
    """Returns the median time per frame in microseconds. Each call gets a new frame, so that nothing is
    cached.
    """
    convert(replace(frame))
    took = []
    for _ in range(REPEATS):
        fresh = replace(frame)
        begin = time.perf_counter()
        convert(fresh)
        took.append(time.perf_counter() - begin)
    return 1e6 * float(np.median(took))


def _measure_output(output: LiveOutput, frame: LiveFrame) -> float:
    return _microseconds(output.encode_packets, frame)


def _foxglove() -> Callable[[LiveFrame], object]:
    """Returns a function that encodes the messages of a frame without a depth image."""
    transforms, scene, stage = TransformsEncoder(), SceneEncoder(), StageEncoder()
    return lambda frame: (transforms.encode(frame, 0), scene.encode(frame, 0), stage.encode(frame))


def _python_osc(frame: LiveFrame) -> bytes:
    """Encodes the bones of one human and the trackers of three, one by one with python-osc."""
    builder = OscBundleBuilder(IMMEDIATELY)
    first, *others = (frame.find_human_character(name) for name in frame.characters)
    for bone, numbers in zip(first.bones, _bone_numbers(first).tolist(), strict=True):
        builder.add_content(build_msg("/VMC/Ext/Bone/Pos", [bone, *numbers]))
    for human in others:
        for bone, numbers in zip(human.bones, _bone_numbers(human).tolist(), strict=True):
            builder.add_content(build_msg("/VMC/Ext/Tra/Pos", [f"{human.name}/{bone}", *numbers]))
    return builder.build().dgram


def _bone_numbers(human: HumanPose) -> Float:
    """Returns (B, 7) the local position and rotation (x, y, z, w) of each bone in Unity's axes."""
    positions, turns = human.local()
    return np.concatenate([unity_position(positions), unity_rotation(turns)], -1)


def _step_seconds(frames: list[DepthFrame], schemes: tuple[str, ...], rate: float) -> list[float]:
    """Returns the seconds of each frame with the performer, for an edge with these outputs.

    Args:
        rate: frames per second of the camera. The edge skips a frame if it is not ready before the next one,
            as with a real camera. If the rate is infinite, each frame comes when the edge is ready.
    """
    actor = create_actor("chair", nodes=NODES)
    actor.warm_up()
    with contextlib.ExitStack() as stack:
        words = []
        for scheme in schemes:
            kind = socket.SOCK_STREAM if scheme == "foxglove" else socket.SOCK_DGRAM
            receiver = stack.enter_context(socket.socket(socket.AF_INET, kind))
            receiver.bind(("127.0.0.1", 0))
            words.append(f"{scheme}:127.0.0.1:{receiver.getsockname()[1]}")
            if scheme == "foxglove":
                port = receiver.getsockname()[1]
                receiver.close()
        outputs = stack.enter_context(LiveOutputs(open_outputs(collect_output_settings(words, {}))))
        while not outputs.outputs.is_ready:
            time.sleep(0.01)
        if "foxglove" in schemes:
            stack.enter_context(_subscribe_to_all(port))
        outlet = stack.enter_context(Outlet(WireSettings(name="bench", port=0, control_port=0), "reel"))
        edge = Edge(Reel(frames), Tracker(), Stage([actor]), outlet, outputs=outputs)
        seconds, start = list[float](), time.perf_counter()
        for number, frame in enumerate(frames):
            if number == FRAMES // 4:
                edge.stage.possess("chair")
            begin = _wait_until(start + number / rate)
            if begin > start + (number + 1) / rate and math.isfinite(rate):
                continue
            edge.step(frame)
            edge.poll_requests()
            if number >= FRAMES // 4:
                seconds.append(time.perf_counter() - begin)
        return seconds


def _wait_until(moment: float) -> float:
    """Waits until a moment of the performance counter, in seconds. Returns the time afterwards."""
    time.sleep(max(moment - time.perf_counter(), 0.0))
    return time.perf_counter()


def _share_percent(frames: list[DepthFrame], rate: float) -> float:
    """Returns the share of the edge's processor time that passing frames to the outputs takes, in percent.

    Unlike the loss of frames, it hardly depends on other programs on the machine.
    """
    publish, step = LiveOutputs.publish, Edge.step
    seconds = {"publish": 0.0, "step": 0.0}

    def timed(name: str, function: Callable[..., None]) -> Callable[..., None]:
        def call(*arguments: object, **keys: object) -> None:
            begin = time.thread_time()
            function(*arguments, **keys)
            seconds[name] += time.thread_time() - begin

        return call

    LiveOutputs.publish, Edge.step = timed("publish", publish), timed("step", step)
    try:
        _step_seconds(frames, SCHEMES, rate)
    finally:
        LiveOutputs.publish, Edge.step = publish, step
    return 100.0 * seconds["publish"] / seconds["step"]


def _subscribe_to_all(port: int) -> ClientConnection:
    """Returns a client of Foxglove's protocol that has subscribed to every topic, and reads nothing."""
    client = connect(f"ws://127.0.0.1:{port}", subprotocols=[Subprotocol("foxglove.sdk.v1")], legacy=True)
    client.recv()
    channels = json.loads(client.recv())["channels"]
    subscriptions = [{"id": channel["id"], "channelId": channel["id"]} for channel in channels]
    client.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
    return client
