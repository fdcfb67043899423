"""Tests of Rokoko Studio's stream as a sensor, with packets written by hand and by enliven's output.

The packets follow Rokoko's page "Custom Streaming" (JSON v3): Unity's axes, +Y up, +Z forward, metres, and
rotations x, y, z, w. The rotations of the T-pose are those of Rokoko's plug-in for Unity.
"""

import contextlib
import json
import socket
import sys
import time
from pathlib import Path

import lz4.frame
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "outputs"))
sys.path.insert(0, str(Path(__file__).parents[2] / "shared" / "mapping"))
from live_scenes import four_characters
from posed_people import performer

from enliven.errors import InputError
from enliven.outputs.live_frame import LiveFrame
from enliven.outputs.opening import open_outputs
from enliven.outputs.settings import LiveOutputSettings
from enliven.person.joints import Joint
from enliven.rotation import rotate
from enliven_edge.sensors.registry import open_sensor

WAIT = 30.0
T_POSE = {
    "hip": ((0.0, 1.0, 0.0), (0, 0, 0, 1)),
    "spine": ((0.0, 1.1, 0.0), (0, 0, 1, 0)),
    "chest": ((0.0, 1.25, 0.0), (0, 0, 1, 0)),
    "neck": ((0.0, 1.5, 0.0), (0, 0, 1, 0)),
    "head": ((0.0, 1.6, 0.0), (0, 0, 1, 0)),
    "leftUpperArm": ((-0.2, 1.45, 0.0), (-0.5, -0.5, 0.5, -0.5)),
    "leftLowerArm": ((-0.5, 1.45, 0.0), (-0.5, -0.5, 0.5, -0.5)),
    "leftHand": ((-0.75, 1.45, 0.0), (-0.5, -0.5, 0.5, -0.5)),
    "rightUpperArm": ((0.2, 1.45, 0.0), (0.5, -0.5, 0.5, 0.5)),
    "rightLowerArm": ((0.5, 1.45, 0.0), (0.5, -0.5, 0.5, 0.5)),
    "rightHand": ((0.75, 1.45, 0.0), (0.5, -0.5, 0.5, 0.5)),
    "leftUpLeg": ((-0.1, 0.95, 0.0), (0, 0.70711, 0, 0.70711)),
    "leftLeg": ((-0.1, 0.5, 0.0), (0, 0.70711, 0, 0.70711)),
    "leftFoot": ((-0.1, 0.1, 0.0), (0, 0.70711, -0.70711, 0)),
    "leftToe": ((-0.1, 0.02, 0.12), (0, 0.70711, -0.70711, 0)),
    "leftToeEnd": ((-0.1, 0.02, 0.2), (0, 0.70711, -0.70711, 0)),
    "rightUpLeg": ((0.1, 0.95, 0.0), (0, -0.70711, 0, 0.70711)),
    "rightLeg": ((0.1, 0.5, 0.0), (0, -0.70711, 0, 0.70711)),
    "rightFoot": ((0.1, 0.1, 0.0), (0, -0.70711, 0.70711, 0)),
    "rightToe": ((0.1, 0.02, 0.12), (0, -0.70711, 0.70711, 0)),
}
"""Position and rotation of the joints of an actor that faces +Z in the T-pose. In Unity, left is at -X."""


def placement(position, rotation) -> dict:
    return {
        "position": dict(zip("xyz", position, strict=True)),
        "rotation": dict(zip("xyzw", rotation, strict=True)),
    }


def packet(*actors, version="3,0", **more) -> bytes:
    """Returns a packet with the (name, joints) of each actor and all other fields that Rokoko Studio
    sends.
    """
    rows = []
    meta = {"hasGloves": False, "hasLeftGlove": False, "hasRightGlove": False, "hasBody": True}
    common = {"meta": {**meta, "hasFace": True}, "face": {"jawOpen": 12.5}}
    for name, joints in actors:
        body = {joint: placement(*placed) for joint, placed in joints.items()}
        size = {"totalHeight": 1.8, "hipHeight": 1.0}
        rows.append({"name": name, "color": [255, 0, 0], "body": body, "dimensions": size, **common})
    box = placement((0, 0, 0), (0, 0, 0, 1))
    props = [{"name": "Box1", "color": [0, 0, 255], "type": 0, **box}]
    scene = {"timestamp": 1.5, "actors": rows, "characters": [], "props": props}
    return json.dumps({"version": version, "fps": 60, "scene": scene, **more}).encode()


def send(sensor, *packets: bytes) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for data in packets:
            out.sendto(data, ("127.0.0.1", sensor.port))


@pytest.mark.parametrize("compress", [False, True])
def test_the_t_pose_of_rokoko_faces_forward_with_the_arms_out(compress):
    data = packet(("Dimitris", T_POSE))
    with open_sensor("rokoko", port=0) as sensor:
        send(sensor, lz4.frame.compress(data) if compress else data)
        (body,) = sensor.read(WAIT).bodies
    for joint, (x, y, z) in (
        (Joint.HIP_CENTER, (0.0, 1.0, 0.0)),
        (Joint.ELBOW_LEFT, (0.5, 1.45, 0.0)),
        (Joint.WRIST_RIGHT, (-0.75, 1.45, 0.0)),
        (Joint.ANKLE_LEFT, (0.1, 0.1, 0.0)),
        (Joint.FOOT_RIGHT, (-0.1, 0.02, 0.12)),
    ):
        assert np.allclose(body.joints[joint], [x, y, z], atol=1e-6), joint
    assert np.allclose(rotate(body.orientations[Joint.HIP_CENTER], [0.0, 0.0, 1.0]), [0, 0, 1], atol=1e-4)
    # The hands point away from the body. No bone follows the wrist, so its rotation determines the hand.
    assert body.joints[Joint.HAND_LEFT][0] > 0.8 and body.joints[Joint.HAND_RIGHT][0] < -0.8
    assert body.confidence.min() == 1.0


def test_rotations_have_rokokos_axes():
    # The left arm is turned by 90 degrees about +Y: in Unity's axes from -X to +Z, which is to the front.
    # r = (0, s, 0, s) times t = (-0.5, -0.5, 0.5, -0.5) is (0, -s, s, 0), with s = 0.70711.
    front = (0, -0.70711, 0.70711, 0)
    joints = {
        **T_POSE,
        "leftUpperArm": ((-0.2, 1.45, 0.0), front),
        "leftLowerArm": ((-0.2, 1.45, 0.3), front),
        "leftHand": ((-0.2, 1.45, 0.55), front),
        # The head looks to its left: -90 degrees about +Y. (0, -s, 0, s) times (0, 0, 1, 0) is (-s, 0, s, 0).
        "head": ((0.0, 1.6, 0.0), (-0.70711, 0, 0.70711, 0)),
    }
    with open_sensor("rokoko", port=0) as sensor:
        send(sensor, packet(("A", joints)))
        (body,) = sensor.read(WAIT).bodies
    hand = body.joints[Joint.HAND_LEFT] - body.joints[Joint.WRIST_LEFT]
    assert hand[2] > 0.07 and abs(hand[0]) < 1e-4, "the rotation of the hand points to the front"
    look = rotate(body.orientations[Joint.HEAD], [0.0, 0.0, 1.0])
    assert np.allclose(look, [1.0, 0.0, 0.0], atol=1e-4), "the person's left is +X"


@pytest.mark.slow
def test_a_performer_returns_through_rokoko():
    body = performer()
    with open_sensor("rokoko", port=0) as sensor:
        for compress in (True, False):
            settings = LiveOutputSettings(f"rokoko:127.0.0.1:{sensor.port}", compress=compress)
            with open_outputs({"r": settings}) as outputs:
                outputs.put(LiveFrame(0, {1: body}))
                (read,) = sensor.read(WAIT).bodies
    exact = [joint for joint in Joint if joint not in (Joint.HEAD, Joint.HAND_LEFT, Joint.HAND_RIGHT)]
    assert np.allclose(read.joints[exact], body.joints[exact], atol=2e-4)
    assert np.abs(read.joints - body.joints).max() < 0.03
    for joint in Joint:
        for axis in np.eye(3):
            same = rotate(read.orientations[joint], axis) @ rotate(body.orientations[joint], axis)
            assert same > 0.999, joint


def test_several_actors_keep_their_ids():
    frame = four_characters()
    with (
        open_sensor("rokoko", port=0) as sensor,
        open_outputs({"r": LiveOutputSettings(f"rokoko:127.0.0.1:{sensor.port}")}) as outputs,
    ):
        outputs.put(frame)
        bodies = sensor.read(WAIT).bodies
        assert [body.id for body in bodies] == [1, 2, 3, 4], "two performers and two human characters"
        send(sensor, packet(("ben", T_POSE), ("new", T_POSE), ("new", T_POSE)))
        assert [body.id for body in sensor.read(WAIT).bodies] == [4, 5, 6]
        send(sensor, packet())
        assert sensor.read(WAIT).bodies == []


def test_the_newest_of_waiting_packets_is_read():
    def moved(step):
        return {**T_POSE, "hip": ((float(step), 1.0, 0.0), (0, 0, 0, 1))}

    with open_sensor("rokoko", port=0) as sensor:
        send(sensor, *(packet(("A", moved(step))) for step in range(20)))
        (body,) = sensor.read(WAIT).bodies
        assert body.joints[Joint.HIP_CENTER][0] == pytest.approx(-19.0)
        with pytest.raises(TimeoutError, match="no actors arrived"):
            sensor.read(0.05)


@pytest.mark.parametrize(
    ("data", "shown"),
    [
        (json.dumps({"version": "2,0", "timestamp": 1, "actors": []}).encode(), "2,0"),
        (json.dumps({"version": 1}).encode(), "1"),
        (packet(("A", T_POSE), version=3, trackers=[]), r"2\.5"),
    ],
)
def test_another_version_is_named_with_advice(data, shown):
    with open_sensor("rokoko", port=0) as sensor:
        send(sensor, data)
        with pytest.raises(InputError, match=rf"JSON of version {shown}.*choose.*JSON v3"):
            sensor.read(WAIT)
        for version in ("3,0", "3.1", 3, 3.0):
            send(sensor, packet(("A", T_POSE), version=version))
            assert len(sensor.read(WAIT).bodies) == 1


def test_hostile_packets_are_ignored():
    bomb = lz4.frame.compress(b" " * 50_000_000)
    whole = packet(("A", T_POSE))
    text = whole.decode()
    broken = {**T_POSE, "head": ((1e9, 0.0, 0.0), (0, 0, 0, 1)), "neck": ((0.0, 1.0, 0.0), (0, 0, 0, 0))}
    with open_sensor("rokoko", port=0) as sensor:
        for data in (
            *(b"", b"x", b"[]", b"{}", b"[" * 60_000, b"{\"scene\":" * 6_000, bytes(500), b"\xff" * 64),
            *(whole[:-30], lz4.frame.compress(whole)[:-20], lz4.frame.compress(whole)[:10], bomb[:60_000]),
            text.replace("1.45", "NaN").encode(),
            text.replace("1.45", "1e999").encode(),
            text.replace("1.45", '"high"').encode(),
            text.replace('"body"', '"nobody"').encode(),
            packet(("A", {"leftHand": T_POSE["leftHand"]})),
        ):  # fmt: skip
            send(sensor, data)
            with contextlib.suppress(TimeoutError):
                assert sensor.read(0.2).bodies == [], data[:40]
        send(sensor, packet(("A", broken)))
        (body,) = sensor.read(WAIT).bodies
        assert body.confidence[Joint.HEAD] == 0.0 and np.isfinite(body.joints).all()
        assert np.abs(body.joints).max() < 3.0, "the head is placed by average proportions"


def test_a_flood_of_actors_is_limited():
    with open_sensor("rokoko", port=0) as sensor:
        begin = time.process_time()
        hip = {"hip": T_POSE["hip"]}
        for step in range(30):
            send(sensor, packet(*((f"actor {step} {k}" * 20, hip) for k in range(60))))
            assert len(sensor.read(WAIT).bodies) <= 8
        assert len(sensor._ids) <= 64 and time.process_time() - begin < 20.0
