"""Tests of motion from other programs as sensors: VMC and OSC trackers, sent by enliven and by other
programs.
"""

import contextlib
import socket
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import build_msg

sys.path.insert(0, str(Path(__file__).parents[1] / "outputs"))
sys.path.insert(0, str(Path(__file__).parents[2] / "shared" / "mapping"))
from posed_people import performer
from sample_meshes.chair import make_chair

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.errors import InputError, ResourceError
from enliven.outputs.live_frame import LiveFrame
from enliven.outputs.opening import open_outputs
from enliven.outputs.settings import collect_output_settings
from enliven.person.joints import Joint
from enliven.possession import ActorSettings, EmbeddedActor
from enliven.rotation import rotate
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.registry import open_sensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker

WAIT = 30.0


def received(sensor, scheme: str, frame: LiveFrame, frames: int = 1):
    """Sends frames through an output of enliven. Returns the bodies of the last frame."""
    with open_outputs(collect_output_settings([f"{scheme}:127.0.0.1:{sensor.port}"], {})) as outputs:
        for _ in range(frames):
            outputs.put(frame)
            bodies = sensor.read(WAIT).bodies
        return bodies


def send(port: int, *messages) -> None:
    """Sends messages as another program would, in one bundle."""
    builder = OscBundleBuilder(IMMEDIATELY)
    for address, *arguments in messages:
        builder.add_content(build_msg(address, list(arguments)))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        out.sendto(builder.build().dgram, ("127.0.0.1", port))


def test_a_performer_returns_through_vmc():
    body = performer()
    with open_sensor("vmc", port=0) as sensor:
        (read,) = received(sensor, "vmc", LiveFrame(0, {1: body}), 2)
    exact = [joint for joint in Joint if joint not in (Joint.HEAD, Joint.HAND_LEFT, Joint.HAND_RIGHT)]
    assert np.allclose(read.joints[exact], body.joints[exact], atol=1e-4)
    assert np.abs(read.joints - body.joints).max() < 0.03
    assert read.confidence.min() == 1.0 and read.height == pytest.approx(1.75, abs=0.08)
    for joint in Joint:
        for axis in np.eye(3):
            same = rotate(read.orientations[joint], axis) @ rotate(body.orientations[joint], axis)
            assert same > 0.999, joint


def test_rotations_alone_give_a_person_of_average_proportions():
    still = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    half = float(np.sqrt(0.5))
    names = (
        "Hips",
        "Spine",
        "Chest",
        "Neck",
        "Head",
        "LeftLowerArm",
        "LeftHand",
        "RightUpperArm",
        "RightLowerArm",
    )
    with open_sensor("vmc", port=0, height=1.6) as sensor:
        bones = [("/VMC/Ext/Bone/Pos", name, *still) for name in names]
        # The left arm is forward: in Unity's axes, a quarter turn about +Y from -X to +Z.
        bones.append(("/VMC/Ext/Bone/Pos", "LeftUpperArm", 0.0, 0.0, 0.0, 0.0, half, 0.0, half))
        bones[0] = ("/VMC/Ext/Bone/Pos", "Hips", 0.5, 0.9, -1.0, 0.0, 0.0, 0.0, 1.0)
        send(sensor.port, *bones)
        (body,) = sensor.read(WAIT).bodies
    assert np.allclose(body.joints[Joint.HIP_CENTER], [-0.5, 0.9, -1.0])
    arm = body.joints[Joint.WRIST_LEFT] - body.joints[Joint.SHOULDER_LEFT]
    assert np.allclose(arm, [0.0, 0.0, np.linalg.norm(arm)], atol=1e-6) and np.linalg.norm(arm) > 0.4
    right = body.joints[Joint.ELBOW_RIGHT] - body.joints[Joint.SHOULDER_RIGHT]
    assert right[0] < -0.2 and abs(right[1]) < 1e-6
    assert body.confidence[Joint.ELBOW_LEFT] == 1.0 and body.confidence[Joint.KNEE_LEFT] == 0.0
    assert np.isfinite(body.joints).all()


def test_a_sender_without_a_figure_gives_no_body():
    with open_sensor("vmc", port=0) as sensor:
        assert len(received(sensor, "vmc", LiveFrame(0, {1: performer()}))) == 1
        send(sensor.port, ("/VMC/Ext/OK", 0))
        assert sensor.read(WAIT).bodies == []
        with pytest.raises(TimeoutError, match="no bones arrived"):
            sensor.read(0.05)


def test_garbage_is_ignored():
    with open_sensor("vmc", port=0) as sensor:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            for data in (b"", b"x", b"#bundle\0garbage", b"/a\0\0,f\0\0", bytes(500), b"\xff" * 64):
                out.sendto(data, ("127.0.0.1", sensor.port))
        bone = "/VMC/Ext/Bone/Pos"
        send(
            sensor.port,
            (bone, "Hips", float("nan"), 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            (bone, "Hips", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (bone, "Hips", 1e9, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            (bone, "Hips"),
            (bone, 1.0),
            (bone, "Tentacle", 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            ("/VMC/Ext/Blend/Val", "Joy", 1.0),
        )
        begin = time.monotonic()
        while time.monotonic() - begin < 0.3:
            with contextlib.suppress(TimeoutError):
                assert sensor.read(0.05).bodies == []
        assert len(received(sensor, "vmc", LiveFrame(0, {1: performer()}))) == 1


@pytest.mark.slow
def test_motion_suit_of_another_program_moves_a_mesh():
    graph = DeformationGraph.build(make_chair(0.05), nodes=24, seed=0)
    actor = EmbeddedActor(
        character_from_graph(make_chair(0.05), graph, "chair"), graph, ActorSettings(fade=0.0)
    )
    with (
        open_sensor("vmc", port=0) as sensor,
        open_outputs(collect_output_settings([f"vmc:127.0.0.1:{sensor.port}"], {})) as outputs,
        Outlet(WireSettings(name="suit", port=0, control_port=0), "vmc") as outlet,
    ):
        edge, places = Edge(sensor, Tracker(), Stage([actor]), outlet), []
        for k in range(20):
            body = performer(place=(0.4 + 0.03 * max(k - 5, 0), 0.94, -2.0))
            outputs.put(LiveFrame(k, {1: body}))
            edge.step(sensor.read(WAIT))
            if k == 3:
                edge.stage.possess("chair")
            places.append(edge.stage.perform(edge.stage._bodies, k * 10**7)[0].positions.mean(0)[0])
    assert edge.stage.holders and places[-1] - places[5] > 0.2, "the chair follows the performer to +X"


def test_trackers_become_a_body():
    body = performer()
    with open_sensor("osc-trackers", port=0) as sensor:
        (read,) = received(sensor, "vrchat", LiveFrame(0, {1: body}))
    tracked = (
        "HIP_CENTER",
        "SHOULDER_CENTER",
        "HEAD",
        "ANKLE_LEFT",
        "ANKLE_RIGHT",
        "KNEE_LEFT",
        "ELBOW_RIGHT",
    )
    for name in tracked:
        assert np.allclose(read.joints[Joint[name]], body.joints[Joint[name]], atol=1e-4), name
        assert read.confidence[Joint[name]] == 1.0
    assert read.confidence[Joint.WRIST_LEFT] == 0.0 and np.isfinite(read.joints).all()
    # The estimated shoulders are on the correct sides.
    left = body.joints[Joint.SHOULDER_LEFT] - body.joints[Joint.SHOULDER_RIGHT]
    assert (read.joints[Joint.SHOULDER_LEFT] - read.joints[Joint.SHOULDER_RIGHT]) @ left > 0


def test_trackers_in_another_order_and_too_few():
    with open_sensor("osc-trackers", port=0, order="left_foot, right foot, hip, chest") as sensor:
        send(sensor.port, ("/tracking/trackers/1/position", 0.1, 0.1, 0.0))
        assert sensor.read(WAIT).bodies == [], "without a hip and a chest there is no person"
        send(
            sensor.port,
            *(
                ("/tracking/trackers/3/position", 0.0, 0.9, 0.0),
                ("/tracking/trackers/4/position", 0.0, 1.35, 0.0),
            ),
        )
        (body,) = sensor.read(WAIT).bodies
    assert np.allclose(body.joints[Joint.ANKLE_LEFT], [-0.1, 0.1, 0.0])
    assert body.confidence[Joint.ANKLE_RIGHT] == 0.0


@pytest.mark.parametrize("name", ["vmc", "osc-trackers", "rokoko"])
def test_a_port_in_use_is_refused(name):
    with (
        open_sensor(name, port=0) as sensor,
        pytest.raises(ResourceError, match=r"cannot be opened.*another port"),
    ):
        open_sensor(name, port=sensor.port)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("vmc", {"port": 70_000}, "70000 is not a UDP port"),
        ("rokoko", {"port": -1}, "-1 is not a UDP port"),
        ("vmc", {"height": 17.0}, r"the height is 17\.0 m\. Set height to 0\.5 to 2\.5 m"),
        ("osc-trackers", {"order": "hip, nose"}, "'nose' is not a place.*left foot"),
        ("osc-trackers", {"order": "hip, " * 8 + "hip"}, "9 places are named, but at most 8"),
    ],
)
def test_wrong_options_are_refused(name, options, message):
    with pytest.raises(InputError, match=message):
        open_sensor(name, **options)


@pytest.mark.parametrize("name", ["vmc", "osc-trackers", "rokoko"])
def test_waiting_ends_in_time_and_a_closed_sensor_has_ended(name):
    sensor = open_sensor(name, port=0)
    begin = time.monotonic()
    with pytest.raises(TimeoutError):
        sensor.read(0.1)
    assert 0.05 < time.monotonic() - begin < 5.0
    sensor.close()
    sensor.close()
    assert sensor.read(0.1) is None
    assert not [thread for thread in threading.enumerate() if "vmc" in thread.name]
