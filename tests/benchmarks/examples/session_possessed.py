"""A chair is possessed, overdubbed, merged with a cactus as its back while both play, and performed again.

It uses the performer of the interleaved session, and the real edge program. The chair has no skeleton, and
the cactus moves by example poses. The result of the merge is a mesh with nodes that plays the motions of
both.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from made_performer import write_performer
from real_edge import RealEdge
from session_interleaved import PACE, joined, recorded, until
from studio_driver import Action, Click, Do, Drag, Key, Name, Near, Say, Spot, Wait, Widget

from enliven.arrays import Float
from enliven.document import GraphCharacter
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.workspace.files import add_sample
from enliven_viewer.studio.workspace.workspace import Workspace

Actions = Iterator[Action]
_SEAT = 0.53
"""Height of the cut, as a fraction of the chair's height: above its seat, and below the armrests."""
_MIDDLE = 0.12
"""Radius around the middle of the seat in which its top is searched, metres: the pot's radius."""
_ASIDE = 0.2
"""Distance from the seat's middle at which the cactus is held before it is dropped, metres."""
_OVER = 12.0
"""Distance above the pot's rim at which the pointer grabs it, pixels. At the rim itself, the pointer may miss
it.
"""
_NEAR = 0.015
"""An object has arrived if it is within this distance of its target, metres."""
_SUNK = 0.06
"""Depth to which the pot stands inside the seat, metres. Surfaces that only touch have no union."""


def possessed(workspace: Workspace, folder: Path) -> Actions:
    """Runs the whole session."""
    write_performer(folder / "person.mcap")
    edge = RealEdge("--recording", str(folder / "person.mcap"), "--loop", "--speed", str(PACE))
    with contextlib.closing(edge):
        edge.wait()
        yield from _sitting(workspace, edge)


def _sitting(workspace: Workspace, edge: RealEdge) -> Actions:
    editor = workspace.editor
    yield from joined(workspace, edge)
    yield Say("The legs of a person are the legs of a chair")
    yield from recorded(workspace, "chair", "3")
    yield Say("It plays at once")
    yield Wait(3.0)
    yield Say("Recorded over: the back, while the legs walk")
    yield Key("home")
    yield from recorded(workspace, "chair", "2")
    assert len(chair(editor).over) == 1, "the second recording took the place of the first"
    yield Say("Legs and back, layer over layer")
    yield Wait(3.5)
    yield Say("A puppet comes to it")
    yield Key("ctrl+2")
    yield Do(_replace_back)
    yield Key("f")
    yield Key("1")
    yield Wait(0.6)
    yield Say("...and plays what the performer did")
    yield Click(Widget("takes"))
    yield Wait(0.3)
    yield Click(Widget("pick take 1"))
    yield Wait(2.5)
    yield from _seat_cactus(workspace)
    yield Say("Perform again, on what came of the two")
    yield Key("ctrl+enter")
    states = workspace.state(PerformSession).staged.sender.states
    yield from until(lambda: states.get("chair") == "on the stage", "it on the stage")
    yield Key("ctrl+1")
    yield Key("home")
    yield from recorded(workspace, "chair", "2")
    assert len(chair(editor).over) == 2, "what was performed last is no layer"
    yield Say("One sitting, one window")
    yield Key("ctrl+2")
    yield Key("f")
    yield Wait(5.0)


def _replace_back(workspace: Workspace) -> None:
    add_sample(workspace.editor, "cactus")


def _seat_cactus(workspace: Workspace) -> Actions:
    """Cuts off the chair's back while everything plays, and merges the cactus onto its seat."""
    editor = workspace.editor
    yield Say("Cut the back off while both play")
    if not editor.playing:
        yield Key("space")
    yield Key("q")
    yield Click(Widget("character chair"))
    yield Key("1")
    yield Wait(0.6)
    yield Key("c")
    low, high = extent(editor, "chair")
    level, depth = low[1] + _SEAT * (high[1] - low[1]), (low[2] + high[2]) / 2
    yield Drag((Spot(high[0] + 0.15, level, depth), Spot(low[0] - 0.15, level, depth)), 0.4)
    yield from until(lambda: len(editor.project.characters) > 2, "the cut")
    pieces = [name for name in editor.project.characters if name != "cactus"]
    seat, back = sorted(pieces, key=lambda name: float(extent(editor, name)[0][1]))
    yield Wait(0.8)
    yield Key("q")
    yield Click(Widget(f"character {back}"))
    yield Key("delete")
    if seat != "chair":
        yield Click(Widget(f"character {seat}"))
        yield Name("chair")
        yield Key("q")
    yield Say("...and give it a cactus instead")
    yield Key("g")
    target = find_seat_top(editor) - np.array([0.0, _SUNK, 0.0])
    beside = target + np.array([_ASIDE, 0.0, 0.0])
    yield from _carry_cactus(editor, "3", beside)
    yield from _carry_cactus(editor, "1", beside)
    foot = lowest(editor, "cactus")
    yield Drag(_make_drag_over(foot, foot - np.array([_ASIDE, 0.0, 0.0])), 1.0, shift=True)
    yield from until(lambda: list(editor.project.characters) == ["chair"], "the merge")
    yield Say("Chair and cactus are one; all motion is kept")
    yield Key("f")
    yield Key("space")
    yield Wait(4.0)


def _carry_cactus(editor: Editor, view: str, target: Float) -> Actions:
    """Drags the cactus in a view until its lowest point is at a target, except for the view's depth.

    The pointer grabs the surface in front of that point. This surface is nearer to the camera, so one drag is
    too short.
    """
    across = np.array([0.0, 1.0, 1.0]) if view == "3" else np.array([1.0, 1.0, 0.0])
    yield Key(view)
    yield Key("f")
    yield Wait(0.8)
    for seconds in (1.2, 0.4, 0.3):
        foot = lowest(editor, "cactus")
        left = (target - foot) * across
        if np.abs(left).max() < _NEAR:
            return
        yield Drag(_make_drag_over(foot, foot + left), seconds)
        yield Wait(0.2)


def _make_drag_over(*places: Float) -> tuple[Near, ...]:
    """Returns a drag of the cactus by its pot that moves its foot over the positions (3,), metres."""
    return tuple(Near(Spot(*map(float, place)), 0.0, -_OVER) for place in places)


def find_seat_top(editor: Editor) -> Float:
    """Returns (3,) the top of the middle of the seat at its current position, metres."""
    vertices = editor.stage_character("chair").vertices
    middle = (vertices.min(0) + vertices.max(0)) / 2
    around = np.abs(vertices[:, [0, 2]] - middle[[0, 2]]).max(1) < _MIDDLE
    return np.array([middle[0], vertices[around, 1].max(), middle[2]])


def chair(editor: Editor) -> GraphCharacter:
    """Returns the possessed chair."""
    return editor.project.graph("chair")


def extent(editor: Editor, name: str) -> tuple[Float, Float]:
    """Returns the corners, (3,) and (3,) metres, of a character's current bounding box."""
    vertices = editor.stage_character(name).vertices
    return vertices.min(0), vertices.max(0)


def lowest(editor: Editor, name: str) -> Float:
    """Returns (3,) the middle of a character's current contact area with the floor, metres."""
    vertices = editor.stage_character(name).vertices
    return np.asarray(vertices[vertices[:, 1] < vertices[:, 1].min() + _NEAR].mean(0))
