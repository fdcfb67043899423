"""Tests that a window sends what it shows to real receivers: projects, takes and live stages."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from in_a_window import in_a_window
from live_receivers import Avatar, OscReceiver
from made_people import convention_name, person
from patience import wait_until

from enliven import cli
from enliven.document import FREE, Clip, Project, Skeleton, SkinWeights, still_shape
from enliven.formats.project.file import write_project
from enliven.meshes import Mesh
from enliven.motion.layers.retarget import bind_chain
from enliven.outputs.opening import open_outputs
from enliven.outputs.settings import collect_output_settings
from enliven.person import Body
from enliven.rotation import IDENTITY, from_rotation_vector, unit
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.playback.document import Document
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.window.live_outputs import WindowOutputs
from enliven_viewer.studio.workspace.workspace import Workspace

MIRROR = np.array([-1.0, 1.0, 1.0])
"""From enliven's axes to Unity's."""
ARM = ("Left shoulder", "Left elbow", "Left wrist")
LENGTH_S = 2.0


def waving(name: str, take: str, project: Project, *, mesh: bool = True, lift: float = 1.0) -> Project:
    """Returns a project with one more person, whose left arm swings forward within two seconds."""
    skeleton = person("vrm")
    shape = still_shape(name, skeleton, *(triangles(skeleton) if mesh else ()))
    frames, chain = 21, tuple(skeleton.index(convention_name("vrm", joint)) for joint in ARM)
    turns = np.tile(IDENTITY, (frames, len(skeleton), 1))
    angles = lift * np.linspace(0.0, 1.2, frames)
    for joint in chain[1:]:
        turns[:, joint] = from_rotation_vector(angles[:, None] * [0.0, -1.0, 0.0])
    clip = Clip(take, skeleton, turns, np.tile(skeleton.positions[0], (frames, 1)), LENGTH_S / (frames - 1))
    project = project.with_takes(clip).with_characters(shape)
    return bind_chain(project, name, chain, take, chain)


def triangles(skeleton: Skeleton) -> tuple[Mesh, SkinWeights]:
    """Returns a small triangle at the end of each bone, which moves with it."""
    count = len(skeleton)
    corners = (skeleton.positions[:, None] + 0.02 * np.eye(3)).reshape(-1, 3)
    indices = np.zeros((3 * count, 4), np.uint16)
    indices[:, 0] = np.repeat(np.arange(count), 3)
    weights = np.tile(np.float32([1, 0, 0, 0]), (3 * count, 1))
    return Mesh(corners, np.arange(3 * count).reshape(-1, 3)), SkinWeights(indices, weights)


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    return Workspace(Editor(project=waving("anna", "wave", Project())), tmp_path)


def opened(workspace: Workspace, *words: str) -> WindowOutputs:
    return WindowOutputs(workspace, open_outputs(collect_output_settings(words, {})))


def bones_of(receiver: OscReceiver) -> dict[str, tuple[float, ...]]:
    return {key[1]: numbers for key, numbers in receiver.values.items() if key[0] == "/VMC/Ext/Bone/Pos"}


def arm_of(workspace: Workspace, name: str, skeleton: Skeleton) -> np.ndarray:
    """Returns (3,) the direction of the left upper arm as drawn by the window."""
    handles = workspace.editor.stage_character(name).handles
    shoulder, elbow = (handles[skeleton.index(convention_name("vrm", joint))] for joint in ARM[:2])
    return unit(elbow - shoulder)


def shows(receiver: OscReceiver, direction: np.ndarray) -> bool:
    """Returns True if the left upper arm of a receiver's avatar has this direction."""
    bones = bones_of(receiver)
    if len(bones) < 15:
        return False
    return bool(np.allclose(Avatar(bones).direction("LeftUpperArm"), MIRROR * direction, atol=1e-4))


@pytest.mark.slow
@pytest.mark.parametrize("mesh", [True, False])
def test_a_project_is_sent_as_it_is_at_the_playhead(tmp_path, mesh):
    workspace = Workspace(Editor(project=waving("anna", "wave", Project(), mesh=mesh)), tmp_path)
    editor, skeleton, seen = workspace.editor, person("vrm"), []
    with OscReceiver() as receiver, opened(workspace, f"vmc:127.0.0.1:{receiver.port}") as outputs:
        for seconds in (0.0, 0.7, 1.5, 0.3):
            editor.time = seconds
            direction = arm_of(workspace, "anna", skeleton)
            wait_until(
                lambda d=direction: (outputs.send(), shows(receiver, d))[1], f"the pose at {seconds} s"
            )
            seen.append(direction)
        # The arm swings to the front, +Z. The last tested time is earlier than the one before it.
        assert seen[0][2] < seen[3][2] < seen[1][2] < seen[2][2] and seen[2][2] > 0.5
        assert receiver.values["/VMC/Ext/OK"] == (1, 3, 0, 1)


@pytest.mark.slow
def test_a_paused_project_sends_its_pose_again_while_the_time_runs(workspace):
    with OscReceiver() as receiver, opened(workspace, f"vmc:127.0.0.1:{receiver.port}") as outputs:
        times = receiver.history["/VMC/Ext/T"]
        wait_until(lambda: (outputs.send(), len(times) >= 4)[1], "four frames")
        assert times[0] == (0.0,) and all(a < b for a, b in pairwise(times))
        poses = receiver.history["/VMC/Ext/Bone/Pos", "LeftUpperArm"]
        wait_until(lambda: len(poses) >= 4, "four poses")
        assert len(set(poses)) == 1


@pytest.mark.slow
def test_several_characters_are_sent_and_hidden_ones_are_not(tmp_path):
    project = waving("ben", "wave back", waving("anna", "wave", Project()), lift=-0.5)
    workspace = Workspace(Editor(project=project), tmp_path)
    skeleton = person("vrm")
    workspace.editor.time = 1.0
    anna, ben = (arm_of(workspace, name, skeleton) for name in ("anna", "ben"))
    assert anna @ ben < 0.9
    with OscReceiver() as first, OscReceiver() as second, OscReceiver() as osc:
        words = [f"vmc:127.0.0.1:{first.port}/anna", f"vmc:127.0.0.1:{second.port}/ben"]
        with opened(workspace, *words, f"osc:127.0.0.1:{osc.port}") as outputs:
            wait_until(lambda: (outputs.send(), shows(first, anna) and shows(second, ben))[1], "both")
            wait_until(lambda: ("/VMC/Ext/Tra/Pos", "ben") in first.values, "the trackers")
            wait_until(lambda: "/enliven/character/ben/position" in osc.values, "the positions")
            hide(workspace, "ben")
            wait_until(
                lambda: (outputs.send(), second.values.get("/VMC/Ext/OK") == (0, 0, 0, 0))[1], "hidden"
            )
            count = len(osc.history["/enliven/character/anna/position"])
            osc.values.pop("/enliven/character/ben/position", None)
            history = osc.history["/enliven/character/anna/position"]
            wait_until(lambda: (outputs.send(), len(history) > count + 2)[1], "later frames")
            assert "/enliven/character/ben/position" not in osc.values


def hide(workspace: Workspace, name: str) -> None:
    """Hides a character as the outliner does."""
    project = workspace.editor.project
    handling = replace(project.handling.get(name, FREE), hidden=True)
    workspace.editor.edit("hide", lambda old: replace(old, handling={**old.handling, name: handling}))


@pytest.mark.slow
def test_a_take_is_sent_as_it_is_at_the_playhead(workspace, tmp_path):
    write_project(tmp_path / "dance.enliven", workspace.editor.project)
    assert cli.run(["export", str(tmp_path / "dance.enliven"), "-o", str(tmp_path / "dance.mcap")]) == 0
    player = Workspace(Editor(), tmp_path / "player")
    perform = player.state(PerformSession)
    perform.active_workspace = "Play"
    perform.follow_take(tmp_path / "dance.mcap")
    live, skeleton = perform.live, person("vrm")
    try:
        wait_until(
            lambda: (perform.advance(0.01), live.document.timeline.end_ns > 1.9e9)[1],
            "the take",
        )
        with OscReceiver() as receiver, opened(player, f"vmc:127.0.0.1:{receiver.port}") as outputs:
            for fraction in (0.0, 0.5, 0.9):
                live.playhead.scrub(fraction)
                perform.advance(0.0)
                workspace.editor.time = live.playhead.time_ns * 1e-9
                direction = arm_of(workspace, "anna", skeleton)

                def arrived(direction=direction):
                    outputs.send()
                    bones = bones_of(receiver)
                    arm = Avatar(bones).direction("LeftUpperArm") if len(bones) >= 15 else np.zeros(3)
                    return np.allclose(arm, MIRROR * direction, atol=0.01)

                wait_until(arrived, f"the pose at {fraction} of the take")
    finally:
        perform.disconnect()


class OnePerformer:
    """A feed with one performer that stands still."""

    def poll(self, document: Document) -> int:
        time_ns = document.timeline.end_ns + 33_000_000
        joints = np.random.default_rng(4).uniform(-1.0, 1.0, (20, 3))
        document.add_bodies(time_ns, [Body(41, joints, np.ones(20), stature=1.7)])
        return 1

    def ask(self, order, then=None) -> None: ...

    def close(self) -> None: ...


@pytest.mark.slow
def test_performers_of_a_stage_are_sent_by_their_numbers(workspace):
    workspace.state(PerformSession).live = LiveStage(OnePerformer(), Document())
    words = ("vrchat", "osc")
    with OscReceiver() as trackers, OscReceiver() as osc:
        ports = (trackers.port, osc.port)
        sent = [f"{word}:127.0.0.1:{port}" for word, port in zip(words, ports, strict=True)]
        with opened(workspace, *sent) as outputs:

            def arrived():
                workspace.state(PerformSession).advance(0.03)
                outputs.send()
                return "/tracking/trackers/head/position" in trackers.values and (
                    "/enliven/performer/1/joint/head" in osc.values
                )

            wait_until(arrived, "the performer")
            assert osc.values["/enliven/event/enter"] == (1,)
            # The project is shown as well. Its characters come in the last packet of a frame.
            wait_until(lambda: "/enliven/character/anna/position" in osc.values, "the character")
            assert osc.values["/enliven/performer/1/height"] == pytest.approx((1.7,))


def said(workspace: Workspace) -> list[str]:
    return [f"{toast.text} {toast.remedy}" for toast in workspace.editor.toasts.shown]


@pytest.mark.slow
def test_a_missing_receiver_is_shown_once(workspace):
    with OscReceiver() as receiver:
        port = receiver.port
    with opened(workspace, f"vmc:127.0.0.1:{port}") as outputs:
        wait_until(lambda: (outputs.send(), said(workspace))[1], "the message")
        for _ in range(30):
            outputs.send()
    (text,) = said(workspace)
    assert (
        f"vmc:127.0.0.1:{port}: the output loses packets: no program receives packets at this address" in text
    )
    assert "Start the receiving program" in text


def test_a_character_without_humanoid_bones_is_shown_as_an_error(workspace):
    chair = still_shape("chair", Skeleton(("a", "b"), np.array([-1, 0]), np.eye(3)[:2]))
    workspace.editor.edit("add", lambda project: project.with_characters(chair))
    with opened(workspace, "vmc:127.0.0.1:9/chair") as outputs:
        outputs.send()
        outputs.send()
        texts = [text for text in said(workspace) if "no humanoid bones" in text]
    assert len(texts) == 1


def test_a_window_without_outputs_sends_nothing(workspace):
    with opened(workspace) as outputs:
        outputs.send()
    assert said(workspace) == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["view", "--film", "f.mp4", "--out", "vmc:127.0.0.1"], "this option needs a window"),
    ],
)
def test_a_film_has_no_live_outputs(words, message, capsys):
    assert cli.run(words) == 3
    assert message in capsys.readouterr().err.replace("\n", " ")


SESSION = """
import contextlib, io, json, sys
from enliven import cli
from live_receivers import OscReceiver

def run(words, source=""):
    with OscReceiver() as receiver:
        with contextlib.redirect_stdout(io.StringIO()):
            status = cli.run([*words, "--seconds", "4", "--out", f"vmc:127.0.0.1:{receiver.port}"])
        arms = receiver.history["/VMC/Ext/Bone/Pos", "LeftUpperArm"]
        return {"status": status, "frames": len(receiver.history["/VMC/Ext/OK"]), "poses": len(set(arms))}

print(json.dumps({
    "studio": run(["studio", sys.argv[1]]),
    "view": run(["view", sys.argv[2]]),
    "wrong": cli.run(["studio", "--out", "vcm:127.0.0.1"]),
}))
"""


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_the_commands_send_from_a_real_window(workspace, tmp_path):
    write_project(tmp_path / "dance.enliven", workspace.editor.project)
    assert cli.run(["export", str(tmp_path / "dance.enliven"), "-o", str(tmp_path / "dance.mcap")]) == 0
    helpers = [path for path in sys.path if path.endswith("helpers")]
    (tmp_path / "session.py").write_text(f"import sys; sys.path[:0] = {json.dumps(helpers)}\n{SESSION}")
    result = in_a_window(
        tmp_path / "session.py", *(str(tmp_path / f"dance.{s}") for s in ("enliven", "mcap"))
    )
    assert result["studio"]["status"] == result["view"]["status"] == 0
    assert result["studio"]["frames"] >= 3 and result["studio"]["poses"] == 1, "the playhead stands still"
    assert result["view"]["frames"] >= 3 and result["view"]["poses"] >= 2, "the take plays"
    assert result["wrong"] == 3
