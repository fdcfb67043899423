"""A chair is possessed, performed over, given a cactus for a back while both play, and performed again.

The performer of the interleaved sitting, and the real program of an edge. The chair has no skeleton, and the
cactus moves by example poses: what comes of the two is a mesh with nodes, which plays all that both did.
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
from enliven.document import GraphShape
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.workspace.files import add_sample
from enliven_viewer.studio.workspace.workspace import Workspace

Actions = Iterator[Action]
_SEAT = 0.53
"""Share of the chair's height at which it is cut: over its seat, and under the rests for the arms."""
_MIDDLE = 0.12
"""Metres around the middle of the seat in which its top is looked for: the pot's radius."""
_ASIDE = 0.2
"""Metres beside the seat's middle where the cactus is held before it is let go on it."""
_OVER = 12.0
"""Pixels over its rim at which the pot is taken hold of: at the rim itself the pointer may miss it."""
_NEAR = 0.015
"""Metres within which a thing is where it was to be carried."""
_SUNK = 0.06
"""Metres by which the cactus's pot stands in the seat: two surfaces that only touch have no union."""


def possessed(workspace: Workspace, folder: Path) -> Actions:
    """The whole sitting."""
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
    yield Do(_cactus)
    yield Key("f")
    yield Key("1")
    yield Wait(0.6)
    yield Say("...and plays what the performer did")
    yield Click(Widget("takes"))
    yield Wait(0.3)
    yield Click(Widget("pick take 1"))
    yield Wait(2.5)
    yield from _seated(workspace)
    yield Say("Perform again, on what came of the two")
    yield Key("ctrl+enter")
    states = workspace.perform.sender.states
    yield from until(lambda: states.get("chair") == "on the stage", "it on the stage")
    yield Key("ctrl+1")
    yield Key("home")
    yield from recorded(workspace, "chair", "2")
    assert len(chair(editor).over) == 2, "what was performed last is no layer"
    yield Say("One sitting, one window")
    yield Key("ctrl+2")
    yield Key("f")
    yield Wait(5.0)


def _cactus(workspace: Workspace) -> None:
    add_sample(workspace.editor, "cactus")


def _seated(workspace: Workspace) -> Actions:
    """The chair's back is cut off while all plays, and the cactus merged onto its seat."""
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
    target = seat_top(editor) - np.array([0.0, _SUNK, 0.0])
    beside = target + np.array([_ASIDE, 0.0, 0.0])
    yield from _carried(editor, "3", beside)
    yield from _carried(editor, "1", beside)
    foot = lowest(editor, "cactus")
    yield Drag(_over(foot, foot - np.array([_ASIDE, 0.0, 0.0])), 1.0, shift=True)
    yield from until(lambda: list(editor.project.characters) == ["chair"], "the merge")
    yield Say("Chair and cactus are one; all motion is kept")
    yield Key("f")
    yield Key("space")
    yield Wait(4.0)


def _carried(editor: Editor, view: str, target: Float) -> Actions:
    """Drags the cactus in a view until its lowest place is at a place, but for the depth of that view.

    The pointer holds the surface before that place, which is nearer to the eye, so that one drag falls short.
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
        yield Drag(_over(foot, foot + left), seconds)
        yield Wait(0.2)


def _over(*places: Float) -> tuple[Near, ...]:
    """A drag of the cactus by its pot: over places (3,), metres, that its foot has."""
    return tuple(Near(Spot(*map(float, place)), 0.0, -_OVER) for place in places)


def seat_top(editor: Editor) -> Float:
    """(3,) metres, the top of the middle of the seat as it is seen now."""
    vertices = editor.posed("chair").vertices
    middle = (vertices.min(0) + vertices.max(0)) / 2
    around = np.abs(vertices[:, [0, 2]] - middle[[0, 2]]).max(1) < _MIDDLE
    return np.array([middle[0], vertices[around, 1].max(), middle[2]])


def chair(editor: Editor) -> GraphShape:
    """The possessed chair."""
    return editor.project.graph("chair")


def extent(editor: Editor, name: str) -> tuple[Float, Float]:
    """(3,) and (3,) metres, the corners of a character's box as it is seen now."""
    vertices = editor.posed(name).vertices
    return vertices.min(0), vertices.max(0)


def lowest(editor: Editor, name: str) -> Float:
    """(3,) metres, the middle of what a character stands on, as it is seen now."""
    vertices = editor.posed(name).vertices
    return np.asarray(vertices[vertices[:, 1] < vertices[:, 1].min() + _NEAR].mean(0))
