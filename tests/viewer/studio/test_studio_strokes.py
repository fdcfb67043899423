"""Tests of random strokes with every tool on any object: no errors, and undo is exact bit for bit."""

from __future__ import annotations

import os
import random
from collections.abc import Iterator

import numpy as np
import pytest
from made_acting_stage import acting_stage
from studio_driver import Action, Click, Drag, HeadlessStage, Key, Pixel, Place, Wait, play

from enliven.document.project import are_identical
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.paint.paint_tool import PaintTool
from enliven_viewer.studio.tools.registry import TOOLS

STROKES = int(os.environ.get("ENLIVEN_STROKES", "20"))
"""Number of strokes; make test-long makes 500."""
BETWEEN = ("ctrl+z", "ctrl+shift+z", "escape", "f", "1", "3", "ctrl+d", "enter", "space", "shift+k", "delete")
"""Keys that are pressed occasionally."""
MOST = 6
"""Maximum number of characters, because copies of copies would take too long."""


def spot(editor: Editor, chance: random.Random) -> Place:
    """Returns a pixel on or near a visible object."""
    visible = [posed for posed in editor.visible_characters if len(posed.extent)]
    at = np.array([chance.random(), chance.random()])
    if visible:
        extent = chance.choice(visible).extent
        pixel = editor.lens.project(np.asarray(extent, float)[[chance.randrange(len(extent))]])[0][0]
        at = np.add(np.nan_to_num(pixel / editor.size), [chance.gauss(0, 0.02), chance.gauss(0, 0.02)])
    return Pixel(*np.clip(at, 0.01, 0.99).tolist())


def strokes(editor: Editor, chance: random.Random) -> Iterator[Action]:
    """Returns a random tool and a stroke with it."""
    yield Key(chance.choice((*TOOLS, PaintTool)).key)
    shift = chance.random() < 0.3
    if chance.random() < 0.4:
        yield Click(spot(editor, chance), shift)
    else:
        places = tuple(spot(editor, chance) for _ in range(chance.randint(2, 5)))
        yield Drag(places, 0.2, shift=shift)
    if chance.random() < 0.5:
        key = chance.choice(BETWEEN)
        if key != "delete" or len(editor.project.characters) > 2:
            yield Key(key if key != "ctrl+d" or len(editor.project.characters) < MOST else "escape")
    yield Wait(0.1)


@pytest.mark.slow
def test_strokes_of_every_tool_at_random_are_undone_bit_for_bit(tmp_path) -> None:
    workspace, chance = acting_stage(tmp_path, 700, 520), random.Random(23)
    editor, stage = workspace.editor, HeadlessStage(workspace)
    first, done = editor.project, 0
    for number in range(STROKES):
        before = editor.history.current_step
        play(list(strokes(editor, chance)), stage)
        done += editor.history.current_step != before
        faults = [
            toast.text for toast in editor.toasts.shown if "enliven has an internal error" in toast.text
        ]
        assert not faults, (number, workspace.input.tool.name, faults)
    assert done > STROKES // 6, "many of them did something"
    play([Key("escape"), Key("escape")], stage)
    last, at = editor.project, editor.history.current_step
    editor.go_to(0)
    assert are_identical(editor.project, first)
    editor.go_to(at)
    assert are_identical(editor.project, last)
