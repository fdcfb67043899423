"""Tests of integrations/blender in a real Blender: import, live receiver, and conversion to FBX.

They are skipped without Blender. `apt install blender python3-numpy` installs Debian's. ENLIVEN_BLENDER names
another command that runs a script: "/opt/blender/blender -b --factory-startup -P", or a Python with bpy.
"""

import json
import os
import shlex
import shutil
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest
from live_receivers import turn as turn_by
from patience import wait_until
from person_bvh import format_bvh, generate_motion

from enliven import cli
from enliven.outputs.live_frame import LiveFrame
from enliven.outputs.opening import open_outputs
from enliven.outputs.settings import collect_output_settings
from enliven.person import Joint
from enliven.rotation import unit

ROOT = Path(__file__).parents[2]
COMMAND = shlex.split(os.environ.get("ENLIVEN_BLENDER", "blender -b --factory-startup -P"))
ADD_ON = ROOT / "integrations" / "blender"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which(COMMAND[0]) is None, reason="Blender is not installed"),
]


def blender(script: Path, *words) -> None:
    """Runs a script in Blender with the system's Python instead of that of the tests."""
    folders = [each for each in os.environ["PATH"].split(os.pathsep) if ".venv" not in each]
    environment = {"PATH": os.pathsep.join(folders), "HOME": os.environ.get("HOME", "/")}
    command = [*COMMAND, str(script), "--", *map(str, words)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and "Traceback" not in done.stdout + done.stderr, done.stdout + done.stderr


def in_blender(task: str, *words, folder: Path) -> dict:
    target = folder / f"{task}.json"
    blender(ROOT / "tests" / "helpers" / "blender_script.py", ADD_ON, task, *words, target)
    return json.loads(target.read_text())


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """Returns the folder with a motion of a person as GLB and BVH, written by enliven."""
    folder = tmp_path_factory.mktemp("blender")
    (folder / "source.bvh").write_text(format_bvh(*generate_motion(25)))
    for name, more in (("person.glb", []), ("person.bvh", []), ("centimetres.bvh", ["--unit", "cm"])):
        words = ["export", str(folder / "source.bvh"), "-o", str(folder / name), "--rate", "25", *more]
        assert cli.run(words) == 0
    return folder


def up_z(places) -> np.ndarray:
    """Returns positions in Blender's axes (+Z up), from those of files with +Y up."""
    places = np.asarray(places)
    return np.stack([places[..., 0], -places[..., 2], places[..., 1]], -1)


class GlbTruth:
    """The node positions of a GLB file in each frame, computed from the glTF specification alone."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        size = int.from_bytes(data[12:16], "little")
        self.document, self.binary = json.loads(data[20 : 20 + size]), data[28 + size :]
        (animation,) = self.document["animations"]
        self.tracks = {}
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            assert sampler["interpolation"] == "LINEAR"
            self.times = self.numbers(sampler["input"]).ravel()
            key = channel["target"]["node"], channel["target"]["path"]
            self.tracks[key] = self.numbers(sampler["output"])

    def numbers(self, index: int) -> np.ndarray:
        accessor = self.document["accessors"][index]
        view = self.document["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        return np.frombuffer(self.binary, "<f4", accessor["count"] * width, start).reshape(-1, width)

    def places(self, frame: int | None) -> dict[str, np.ndarray]:
        """Returns the position of each named node in a frame, or at rest for None."""
        places, nodes = {}, self.document["nodes"]

        def walk(index: int, above: np.ndarray) -> None:
            node = nodes[index]

            def value(path, default):
                track = None if frame is None else self.tracks.get((index, path))
                return np.array(node.get(path, default)) if track is None else track[frame]

            x, y, z, w = value("rotation", [0.0, 0.0, 0.0, 1.0])
            columns = [turn_by((x, y, z, w), axis) for axis in np.eye(3)]
            turn = np.stack(columns, -1)
            matrix = np.eye(4)
            matrix[:3, :3] = turn * value("scale", [1.0, 1.0, 1.0])
            matrix[:3, 3] = value("translation", [0.0, 0.0, 0.0])
            matrix = above @ matrix
            places[node.get("name", "")] = matrix[:3, 3]
            for child in node.get("children", ()):
                walk(child, matrix)

        for root in self.document["scenes"][0]["nodes"]:
            walk(root, np.eye(4))
        return places


def joint_error(frames, truth: GlbTruth) -> float:
    """Returns the largest distance in metres between a joint and its position in the file, over all
    frames.
    """
    worst = 0.0
    for number, frame in enumerate(frames):
        expected = truth.places(number)
        assert len(set(frame) & set(expected)) > 10
        worst = max(worst, *(np.linalg.norm(up_z(expected[name]) - frame[name]) for name in frame))
    return worst


def test_a_glb_is_imported_with_its_rest_pose_rate_and_range(exported):
    shown, truth = (
        in_blender("import", exported / "person.glb", folder=exported),
        GlbTruth(exported / "person.glb"),
    )
    rest = truth.places(None)
    for name, (head, _) in shown["rest"].items():
        assert np.allclose(head, up_z(rest[name]), atol=1e-4), name
    for bone, child in (("LeftArm", "LeftForeArm"), ("RightForeArm", "RightHand"), ("LeftUpLeg", "LeftLeg")):
        assert np.allclose(shown["rest"][bone][1], shown["rest"][child][0], atol=1e-4), (
            f"{bone} ends at {child}"
        )
    assert shown["rate"] == pytest.approx(25.0) and shown["start"] == 0
    assert len(shown["frames"]) == len(truth.times)
    assert np.allclose(shown["keys"], np.round(shown["keys"]), atol=1e-3), "keys lie on frames"
    assert joint_error(shown["frames"], truth) < 1e-3


@pytest.mark.parametrize("name", ["person.bvh", "centimetres.bvh"])
def test_a_bvh_is_imported_with_the_same_motion(exported, name):
    shown, truth = (
        in_blender("import", exported / name, folder=exported),
        GlbTruth(exported / "person.glb"),
    )
    assert shown["rate"] == pytest.approx(25.0, abs=0.01) and len(shown["frames"]) == len(truth.times)
    for number, frame in enumerate(shown["frames"]):
        expected = truth.places(number)
        for joint in ("Hips", "LeftForeArm", "RightHand", "LeftFoot", "Head"):
            assert np.allclose(frame[joint], up_z(expected[joint]), atol=2e-3), (number, joint)


def test_a_rig_follows_a_performer_live(exported, tmp_path):
    from posed_people import performer

    body, port_file, stop = performer(), tmp_path / "port", threading.Event()

    def keep_sending():
        wait_until(lambda: port_file.exists() or stop.is_set(), "Blender listens")
        if stop.is_set():
            return
        with open_outputs(collect_output_settings([f"vmc:127.0.0.1:{port_file.read_text()}"], {})) as outputs:
            number = 0
            while not stop.wait(0.02):
                number += 1
                outputs.put(LiveFrame(number * 20_000_000, {1: body}))

    thread = threading.Thread(target=keep_sending)
    thread.start()
    try:
        shown = in_blender("receive", exported / "person.glb", port_file, folder=tmp_path)
    finally:
        stop.set()
        thread.join()
    assert shown["updates"] == 20 and len(shown["matched"]) > 12
    heads = {name: np.array(place) for name, place in shown["heads"].items()}
    for side in ("Left", "Right"):
        for begin, end, joints in (
            ("Arm", "ForeArm", ("SHOULDER", "ELBOW")),
            ("ForeArm", "Hand", ("ELBOW", "WRIST")),
            ("UpLeg", "Leg", ("HIP", "KNEE")),
            ("Leg", "Foot", ("KNEE", "ANKLE")),
        ):
            first, second = (body.joints[Joint[f"{joint}_{side.upper()}"]] for joint in joints)
            way = unit(heads[side + end] - heads[side + begin])
            assert np.allclose(way, up_z(unit(second - first)), atol=0.02), side + begin
    # The left arm points to the front. That is -Y for a figure without rotation, but this one faces +X.
    arm = unit(heads["LeftForeArm"] - heads["LeftArm"])
    assert arm[1] < -0.5 and heads["LeftArm"] @ [1.0, 0.0, 0.0] > heads["RightArm"] @ [1.0, 0.0, 0.0]
    hips = up_z(body.joints[Joint.HIP_CENTER])
    legs = np.linalg.norm(heads["LeftLeg"] - heads["LeftUpLeg"]) + np.linalg.norm(
        heads["LeftFoot"] - heads["LeftLeg"]
    )
    own = body.joints
    figure = np.linalg.norm(own[Joint.KNEE_LEFT] - own[Joint.HIP_LEFT]) + np.linalg.norm(
        own[Joint.ANKLE_LEFT] - own[Joint.KNEE_LEFT]
    )
    assert np.allclose(heads["Hips"], hips * legs / figure, atol=0.02), "the hips move with the room's scale"


@pytest.mark.parametrize("source", ["person.glb", "person.bvh"])
def test_fbx_keeps_the_joints(exported, tmp_path, source):
    target = tmp_path / "person.fbx"
    blender(ADD_ON / "to_fbx.py", exported / source, target)
    assert target.read_bytes().startswith(b"Kaydara FBX Binary")
    assert [path.name for path in tmp_path.iterdir()] == ["person.fbx"], "no partial file"
    shown, truth = in_blender("fbx", target, folder=tmp_path), GlbTruth(exported / "person.glb")
    assert len(shown["frames"]) == len(truth.times)
    for number, frame in enumerate(shown["frames"]):
        expected = truth.places(number)
        for joint in ("Hips", "LeftForeArm", "RightHand", "LeftFoot", "Head"):
            assert np.allclose(frame[joint], up_z(expected[joint]), atol=2e-3), (number, joint)


def test_a_missing_file_is_reported(tmp_path):
    environment = {"PATH": "/usr/bin:/bin", "HOME": "/"}
    command = [*COMMAND, str(ADD_ON / "to_fbx.py"), "--", str(tmp_path / "no.glb"), str(tmp_path / "no.fbx")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 1 and "no.glb" in done.stderr and not list(tmp_path.iterdir())
