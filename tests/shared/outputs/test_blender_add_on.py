"""Tests of the parts of integrations/blender that need no Blender: OSC, VMC, rigs with any rest pose, GLB."""

import socket
import struct
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from live_scenes import four_characters
from made_people import person
from posed_people import performer
from pythonosc.osc_packet import OscPacket

from enliven.outputs.live_frame import LiveFrame
from enliven.outputs.vmc import VmcOutput
from enliven.person import Joint
from enliven.rotation import from_rotation_vector, rotate, unit

sys.path.insert(0, str(Path(__file__).parents[3] / "integrations" / "blender"))
from enliven_live import humanoid
from enliven_live.glb import GlbMotion
from enliven_live.osc import read_packet
from enliven_live.vmc import VmcReceiver

BLENDER = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Rotation from enliven's axes to Blender's."""


def bones_of(body) -> dict:
    """Returns the bones of a performer in the form that the add-on receives."""
    receiver = VmcReceiver("127.0.0.1", 0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for packet in VmcOutput().encode_packets(LiveFrame(0, {1: body})):
            out.sendto(packet, ("127.0.0.1", receiver.port))
    assert receiver.poll() and receiver.is_loaded
    receiver.close()
    return receiver.bones


def test_packets_are_read_as_python_osc_reads_them():
    for packet in VmcOutput().encode_packets(four_characters()):
        expected = [(m.message.address, m.message.params) for m in OscPacket(packet).messages]
        assert read_packet(packet) == expected


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=60), st.integers(0, 10_000), st.integers(0, 255))
def test_broken_packets_are_refused(garbage, place, value):
    packet = bytearray(VmcOutput().encode_packets(LiveFrame(0, {1: performer()}))[0])
    packet[place % len(packet)] = value
    receiver = VmcReceiver("127.0.0.1", 0)
    sent = (garbage, b"/" + garbage, b"#bundle\0" + garbage, bytes(packet), bytes(packet[: place % 200]))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for data in sent:
            out.sendto(data, ("127.0.0.1", receiver.port))
    receiver.poll()
    receiver.close()
    assert receiver.packets == len(sent)
    assert all(np.isfinite([*at, *turn]).all() for at, turn in receiver.bones.values())


def test_a_deep_bundle_is_refused():
    data = b"/a\0\0,\0\0\0"
    for _ in range(2000):
        data = b"#bundle\0" + bytes(8) + struct.pack(">i", len(data)) + data
    with pytest.raises(ValueError, match="nested too deep"):
        read_packet(data)


def rest_rig(convention: str, facing: float, seed: int):
    """Returns the rest pose of a person in Blender's axes, with any facing and any axes of the bones."""
    skeleton = person(convention)
    turn = from_rotation_vector([0.0, facing, 0.0])
    places = rotate(turn, skeleton.positions) @ BLENDER.T
    rests = from_rotation_vector(np.random.default_rng(seed).uniform(-2.0, 2.0, (len(skeleton), 3)))
    rows = []
    for k, name in enumerate(skeleton.names):
        above = skeleton.names[skeleton.parents[k]] if skeleton.parents[k] >= 0 else None
        rows.append((name, above, tuple(places[k]), tuple(rests[k])))
    return rows


def moved_heads(rows, basis, place) -> dict[str, np.ndarray]:
    """Returns the positions of the bones' heads by Blender's rule: parent @ rest relative to the parent @
    basis.
    """
    turns, heads = {}, {}
    rest = {name: (np.array(head), np.array(turn)) for name, _, head, turn in rows}
    for name, above, head, turn in rows:
        start, relative = np.array(head), np.array(turn)
        if above is not None:
            back = humanoid.inverse(rest[above][1])
            relative = humanoid.multiply(back, turn)
            offset = humanoid.rotate(back, np.array(head) - rest[above][0])
            start = heads[above] + humanoid.rotate(turns[above], offset)
            relative = humanoid.multiply(turns[above], relative)
        if place is not None and above is None:
            start = start + humanoid.rotate(relative, place)
        turns[name], heads[name] = humanoid.multiply(relative, basis[name]), start
    return heads


@pytest.mark.parametrize("convention", ["mixamo", "vrm", "unreal", "rigify"])
@pytest.mark.parametrize("facing", [0.0, np.pi, 1.1])
def test_a_rig_with_any_rest_pose_follows_the_performer(convention, facing):
    body = performer()
    rows = rest_rig(convention, facing, seed=4)
    rig = humanoid.Rig(rows)
    heads = moved_heads(rows, *rig.pose(bones_of(body)))
    for side in ("Left", "Right"):
        for begin, end, joints in (
            ("UpperArm", "LowerArm", ("SHOULDER", "ELBOW")),
            ("LowerArm", "Hand", ("ELBOW", "WRIST")),
            ("UpperLeg", "LowerLeg", ("HIP", "KNEE")),
            ("LowerLeg", "Foot", ("KNEE", "ANKLE")),
        ):
            first, second = (body.joints[Joint[f"{joint}_{side.upper()}"]] for joint in joints)
            way = unit(heads[rig.matched[side + end]] - heads[rig.matched[side + begin]])
            assert np.allclose(way, BLENDER @ unit(second - first), atol=1e-4), side + begin


def test_the_legs_need_not_hang_on_the_hips():
    body, bones = performer(), bones_of(performer())
    rows = rest_rig("mixamo", 0.0, seed=1)
    rig = humanoid.Rig(rows)
    hips = next(name for name, above, _, _ in rows if above is None)
    root = ("Root", None, (0.1, 0.2, 0.0), (1.0, 0.0, 0.0, 0.0))
    rows = [root, *((n, "Root" if "UpLeg" in n or n == hips else above, h, q) for n, above, h, q in rows)]
    other = humanoid.Rig(rows)
    assert other.matched["Hips"] == "Root" and rig.matched["Hips"] == hips
    heads = moved_heads(rows, *other.pose(bones))
    expected = moved_heads(rest_rig("mixamo", 0.0, seed=1), *rig.pose(bones))
    for name in expected:
        assert np.allclose(heads[name], expected[name], atol=1e-6), name
    assert heads[hips][2] > 0.5 and body.joints[Joint.HIP_CENTER][1] > 0.5


def test_a_rig_without_hips_is_refused():
    with pytest.raises(ValueError, match=r"no bone for Hips, LeftUpperLeg"):
        humanoid.Rig([("tail", None, (0, 0, 0), (1, 0, 0, 0))])


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"glTF",
        b"no file of this kind at all",
        b"glTF" + struct.pack("<III", 1, 40, 20) + b"JSON" + b" " * 20,
    ],
)
def test_another_file_is_refused(tmp_path, data):
    (tmp_path / "a.glb").write_bytes(data)
    with pytest.raises(ValueError, match=r"a\.glb is not a GLB file of version 2"):
        GlbMotion(str(tmp_path / "a.glb"))
