"""Interleaves performing, modelling and animating: one person, one creature, one run of the real window.

A recorded performer plays through the real edge program. The performer twice selects limbs of a sketched
creature by posing. Their motion is recorded, the second time as an overdub. An arm is cut off and merged
elsewhere while everything plays, and the person performs with the result.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from imgui_bundle import imgui
from made_performer import LENGTH, write_performer
from manifold3d import CrossSection, OpType
from real_edge import RealEdge
from studio_driver import (
    STEP,
    Action,
    Click,
    Do,
    Drag,
    JointPlace,
    Key,
    Name,
    Near,
    OnBone,
    Place,
    Say,
    Spot,
    Wait,
    Widget,
)

from enliven.arrays import Float
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.workspace.workspace import Workspace

Actions = Iterator[Action]
PACE = 0.25
"""Seconds of performance per second of real time. At this speed every frame of the film is drawn in time."""
_PATIENCE = 4000
"""Maximum number of frames to wait for anything, including the edge's start and the compilation of its
kernels."""
_LEVEL = 0.4
"""Maximum slope (rise over run) of an arm, so that it does not hide the head."""


def creature() -> Float:
    """Returns the outline (N, 2), metres, of a creature with two arms, two legs and a head."""
    limbs = (
        (((0.0, 0.62), (0.0, 0.95)), (0.2, 0.17)),
        (((0.1, 0.95), (0.42, 1.05), (0.72, 1.2)), (0.075, 0.06, 0.045)),
        (((-0.1, 0.95), (-0.42, 1.05), (-0.72, 1.2)), (0.075, 0.06, 0.045)),
        (((0.1, 0.6), (0.2, 0.3), (0.24, 0.06)), (0.085, 0.07, 0.06)),
        (((-0.1, 0.6), (-0.2, 0.3), (-0.24, 0.06)), (0.085, 0.07, 0.06)),
        (((0.0, 1.0), (0.0, 1.22)), (0.1, 0.13)),
    )
    pieces = []
    for joints, radii in limbs:
        rounds = [CrossSection.circle(r, 40).translate(at) for at, r in zip(joints, radii, strict=True)]
        pieces += [CrossSection.batch_hull(list(pair)) for pair in itertools.pairwise(rounds)]
    whole = CrossSection.batch_boolean(pieces, OpType.Add)
    return np.array(max(whole.to_polygons(), key=len), np.float64)


def until(done: Callable[[], object], what: str) -> Actions:
    """Waits for a condition, frame by frame.

    Raises:
        TimeoutError: if it does not become true.
    """
    for _ in range(_PATIENCE):
        if done():
            return
        yield Wait(STEP)
    raise TimeoutError(what)


def interleaved(workspace: Workspace, folder: Path) -> Actions:
    """Runs the whole session."""
    write_performer(folder / "person.mcap")
    edge = RealEdge("--recording", str(folder / "person.mcap"), "--loop", "--speed", str(PACE))
    with contextlib.closing(edge):
        edge.wait()
        yield from _sitting(workspace, edge)


def _sitting(workspace: Workspace, edge: RealEdge) -> Actions:
    perform = workspace.state(PerformSession)
    yield Key("1")
    yield Wait(0.6)
    yield Say("Sketch a creature")
    yield Key("s")
    points = creature()
    stroke = [*points[:: max(len(points) // 90, 1)], points[0]]
    yield Drag(tuple(Spot(float(x), float(y)) for x, y in stroke), 2.4)
    yield Wait(0.3)
    yield Name("creature")
    yield Key("q")
    yield Click(JointPlace("creature", 0))
    yield from joined(workspace, edge)
    yield Click(Widget("remove chair"))
    yield Say("Put the creature on the stage")
    yield Key("ctrl+enter")
    yield from until(lambda: perform.stage_ids == ("creature",), "the creature alone on the stage")
    yield Wait(0.5)
    yield Say("Arms like its arms: that chooses them")
    yield from recorded(workspace, "creature", "4")
    yield Say("It plays at once")
    yield Wait(3.0)
    yield Say("A second layer: the legs, while the arms play")
    yield Key("home")
    yield from recorded(workspace, "creature", "3")
    yield Say("Arms and legs, layer over layer")
    yield Wait(3.5)
    yield from _remodel(workspace)
    yield Say("Perform again, on the edited creature")
    yield Key("ctrl+1")
    yield Key("home")
    yield from recorded(workspace, "creature", "4")
    yield Say("One sitting, one window")
    yield Key("ctrl+2")
    yield Key("f")
    yield Wait(5.0)


def joined(workspace: Workspace, edge: RealEdge) -> Actions:
    """Connects the window to the edge with a person in view."""
    perform = workspace.state(PerformSession)
    yield Say("Somebody stands before a camera: go there")
    yield Key("ctrl+1")
    yield Wait(0.4)
    yield Click(Widget("address"))
    yield from typed(edge.address)
    yield from until(
        lambda: perform.performers and "chair" in perform.stage_ids, "a performer, and the chair"
    )
    yield Wait(0.5)


def recorded(workspace: Workspace, name: str, parts: str, seconds: float = 4.5) -> Actions:
    """Possesses a character with parts of the body, by their key, and records. The recording must contain
    motion."""
    perform, editor = workspace.state(PerformSession), workspace.editor
    yield Key("r")
    yield Key(parts)
    yield from at_rest(workspace)
    yield Key("p")
    yield from until(
        lambda: name in {holder.character for holder in perform.holders}, f"who holds the {name}"
    )
    before = editor.project.characters.get(name)
    yield Key("ctrl+r")
    yield from until(lambda: perform.recording.recorder.seconds > seconds, "the recording")
    yield Key("ctrl+r")
    yield from until(lambda: perform.recording.phase == "idle", "the end of the recording")
    if editor.project.characters.get(name) is before:
        raise AssertionError(f"nothing of the {name} was recorded")


def _remodel(workspace: Workspace) -> Actions:
    """Cuts off an arm and merges it onto the head while everything plays."""
    editor = workspace.editor
    yield Key("ctrl+2")
    yield Key("f")
    yield Key("1")
    yield Wait(0.6)
    yield Say("Cut an arm off while it plays")
    if not editor.playing:
        yield Key("space")
    yield Key("c")
    yield from until(lambda: aside("creature", "a1", editor), "the arm aside of the head")
    yield Drag(across("creature", "a1", editor), 0.15)
    yield from until(lambda: len(editor.project.shapes) > 1, "the cut")
    yield Wait(1.0)
    yield Say("...and merge it onto the head")
    part = list(editor.project.shapes)[-1]
    yield Key("g")
    yield Drag((JointPlace(part, 0), JointPlace("creature", "f1")), 1.2)
    yield from until(lambda: len(editor.project.shapes) == 1, "the merge")
    yield Say("All motion is kept")
    yield Wait(3.0)


def aside(shape: str, joint: str, editor: Editor) -> bool:
    """Returns True if the bone that ends at a joint is level on the screen, so that a stroke across it
    crosses nothing else."""
    standing = editor.stage_character(shape)
    number = standing.character.handles.index(joint)
    ends = np.array([standing.on_bone(number, along) for along in (0.0, 1.0)])
    right, down = np.abs(np.diff(editor.lens.project(ends)[0], axis=0)[0])
    return bool(down < _LEVEL * right)


def across(shape: str, joint: str, editor: Editor) -> tuple[Place, Place]:
    """Returns a short stroke perpendicular to the bone that ends at a joint, at its current position on the
    screen."""
    middle = OnBone(shape, joint, 0.6)
    standing = editor.stage_character(shape)
    number = standing.character.handles.index(joint)
    ends = np.array([standing.on_bone(number, along) for along in (0.0, 1.0)])
    along = np.diff(editor.lens.project(ends)[0], axis=0)[0]
    right, down = 30.0 * np.array([-along[1], along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
    return Near(middle, float(right), float(down)), Near(middle, -float(right), -float(down))


def typed(text: str) -> Actions:
    """Types into the focused field, then presses Enter."""
    for letter in text:
        yield Do(lambda _, letter=letter: imgui.get_io().add_input_characters_utf8(letter))
    yield Key("enter")


def at_rest(workspace: Workspace) -> Actions:
    """Waits until the performer has begun to stand still with lifted arms."""
    recorder = workspace.state(PerformSession).recording.recorder
    second = lambda: ((recorder.newest_ns or 0) * 1e-9 - 1.0) % LENGTH  # noqa: E731
    yield from until(lambda: 0.4 < second() < 1.5, "the performer at rest")
