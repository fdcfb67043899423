"""Opens the studio's window on a star, and drags each part of the gizmo with a mouse and with a finger.

Prints the results as JSON.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from made_studio_puppets import studio

from enliven_viewer.studio.features.puppets.gizmo import ARROW_LENGTH_PX, GIZMO_PARTS
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.viewport.overlay import Point
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

BESIDE_PX = 17.0
"""Distance in pixels from an arrow at which only a finger grabs it."""
DRAG: Point = (26.0, -31.0)
report: dict[str, object] = {"done": False}


class Hand:
    """A mouse or a finger. Its positions are the viewport's pixels."""

    def __init__(self, window: StudioWindow) -> None:
        self._window, self._at = window, (0.0, 0.0)

    def settle(self) -> None:
        """Repeats the pointer's position. Call before each frame, because the real pointer is elsewhere."""
        imgui.get_io().add_mouse_pos_event(*self._at)

    def move(self, at: Point) -> None:
        """Moves the pointer at once, as a finger does."""
        area = self._window.places.viewport
        self._at = round(area.x + at[0]), round(area.y + at[1])
        self.settle()

    def press(self, is_down: bool) -> None:
        imgui.get_io().add_mouse_button_event(0, is_down)

    def drag(self, start: Point, *, is_finger: bool, escape: bool = False) -> Iterator[None]:
        """Drags from a pixel. A mouse rests there before the press."""
        self.move((6.0, 6.0))
        yield from (None, None)
        self.move(start)
        if not is_finger:
            yield from (None, None)
        self.press(True)
        yield from (None, None)
        self.move((start[0] + DRAG[0], start[1] + DRAG[1]))
        yield from (None, None)
        if escape:
            for is_down in (True, False):
                imgui.get_io().add_key_event(imgui.Key.escape, is_down)
                yield from (None, None)
        self.press(False)
        yield from (None, None, None)


def find_start(workspace: Workspace, part: str) -> Point:
    """Returns a pixel in the middle of a part of the gizmo."""
    gizmo = workspace.input.tool.manipulator()
    axes = np.eye(3)
    offset = np.zeros(3)
    if len(part) == 1:
        offset = axes[GIZMO_PARTS.index(part)] * 0.7 * ARROW_LENGTH_PX
    elif part != "view":
        offset = (1 - axes[GIZMO_PARTS.index(part) - 3]) * 33.0
    x, y = workspace.editor.lens.project((gizmo.place + offset * gizmo.pixel)[None])[0][0]
    return float(x), float(y)


def find_start_beside(workspace: Workspace, axis: str) -> Point:
    """Returns a pixel next to the outer end of an arrow, at which a mouse does not grab the arrow."""
    start, centre = np.array(find_start(workspace, axis)), np.array(find_start(workspace, "view"))
    along = (start - centre) / np.linalg.norm(start - centre)
    x, y = centre + (start - centre) * 1.3 + BESIDE_PX * np.array([-along[1], along[0]])
    return float(x), float(y)


def work(window: StudioWindow, hand: Hand) -> Iterator[None]:
    """Drags each part, and undoes each drag."""
    workspace, editor = window.workspace, window.workspace.editor
    puppets = get_puppet_editor(editor)
    editor.select_only("star", 0)
    editor.camera.orbit(0.3, 0.35)
    editor.camera.advance(10.0)
    yield from (None, None)

    def measure(start: Point, **options: bool) -> Iterator[None]:
        place, project = puppets.stage_puppet.handles[0].copy(), editor.history.project
        yield from hand.drag(start, **options)
        moved = (puppets.stage_puppet.handles[0] - place).round(5).tolist()
        is_edit = editor.history.project is not project
        if is_edit:
            workspace.actions.do("edit.undo")
        results.append([moved, is_edit, editor.history.project is project])
        yield None
        editor.select_only("star", 0)
        yield from (None, None)

    for name, is_finger in (("mouse", False), ("finger", True)):
        results: list[object] = []
        for part in GIZMO_PARTS:
            yield from measure(find_start(workspace, part), is_finger=is_finger)
        report[name] = dict(zip(GIZMO_PARTS, results, strict=True))
        results = []
        yield from measure(find_start_beside(workspace, "y"), is_finger=is_finger)
        report[f"{name} beside y"] = results[0]
    results = []
    yield from measure(find_start(workspace, "y"), is_finger=False, escape=True)
    report["escape"] = results[0]
    report["bad"] = [toast.text for toast in editor.toasts.shown if toast.is_error]
    report["done"] = True


def main() -> None:
    workspace: Workspace = studio(Path(sys.argv[1]), "left", "right", "head", "foot", take="sway")[0]
    window = StudioWindow(workspace, 1 / 30)
    hand = Hand(window)
    going: list[Iterator[None]] = []

    def before(window: StudioWindow) -> None:
        if window.pictures < 4:
            return
        if not going:
            going.append(work(window, hand))
        hand.settle()
        if next(going[0], StopIteration) is StopIteration:
            workspace.store.forget()
            window.close()

    window.run(before=before, seconds=150)
    print(json.dumps(report))


if __name__ == "__main__":
    main()
