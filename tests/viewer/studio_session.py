"""Opens the studio's window and lets ImGui's test engine work in it. Prints the results as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from coarse_pixels import coarse_pixels
from deeds import menu_path, scripted
from imgui_bundle import ImVec2, imgui

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from cage import Swing, cage_of
from strokes import limb
from studio_driver import JointPlace, Place, where

from enliven.document import PoseStream
from enliven.meshes.mesh import Mesh
from enliven.modeling.sketching.sketch import shape_from_stroke
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.timeline.timeline_input import TimelineInput
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

ROW = "//outliner/**/##{}"
report: dict[str, object] = {"done": False, "errors": []}


def settle(ctx: imgui.test_engine.TestContext, frames: int = 4) -> None:
    """Draws some frames, because an event takes effect in the frame after it."""
    for _ in range(frames):
        ctx.yield_()


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> None:
    """Plays an artist's actions: tools, a menu, a drag in the viewport, keys, and the dialog at the end."""
    workspace = window.workspace
    editor = workspace.editor

    def at(place: Place) -> ImVec2:
        from studio_driver.filming import WindowStage

        return ImVec2(*where(place, WindowStage(window)))

    # Panels are placed in the first frames. The layout depends on this.
    settle(ctx)
    report["size"] = list(window.places.viewport)
    ctx.item_click("tools/##carry")
    report["tool"] = workspace.input.tool.name
    ctx.mouse_move_to_pos(at(JointPlace("one", 0)))
    settle(ctx)
    ctx.mouse_down(0)
    settle(ctx)
    ctx.mouse_move_to_pos(at(JointPlace("two", 1)))
    settle(ctx)
    ctx.mouse_up(0)
    settle(ctx)
    report["merged"] = sorted(editor.project.shapes)
    report["told"] = [toast.text for toast in editor.toasts.shown]
    ctx.menu_click(menu_path("Edit/Undo"))
    report["undone"] = sorted(editor.project.shapes)
    ctx.item_click(ROW.format("character post"))
    settle(ctx)
    bars = workspace.state(TimelineInput).layout.bars()
    report["caged"] = [editor.selection.character, [bar.label for bar in bars]]
    ctx.item_click(ROW.format("character two"))
    report["chosen"] = editor.selection.character
    ctx.item_input_value("side/##name", "mantle")
    report["renamed"] = sorted(editor.project.shapes)
    ctx.item_click("side/###edit.duplicate")
    report["copied"] = sorted(editor.project.shapes)
    ctx.key_press(int(imgui.Key.mod_ctrl) | int(imgui.Key.z))  # Python 3.11.2 cannot combine the keys itself
    report["after ctrl z"] = sorted(editor.project.shapes)
    ctx.item_click(ROW.format("take wave"))
    report["source"] = [workspace.input.tool.name, workspace.input.tool.source.take]
    ctx.key_press(imgui.Key.space)
    report["playing"] = editor.playing
    ctx.key_press(imgui.Key.f1)
    ctx.yield_()
    report["help"] = workspace.asking
    ctx.item_click("//###Keys/###Close")
    ctx.menu_click(menu_path("File/Quit"))
    ctx.yield_()
    report["asks"] = workspace.asking
    ctx.item_click("//###Save your work?/###Cancel")
    report["stays"] = not workspace.ended
    report["done"] = True
    ctx.menu_click(menu_path("File/Quit"))
    ctx.yield_()
    ctx.item_click("//###Save your work?/###Discard")


def main() -> None:
    render = RenderSettings(shadow_size=64, contact_size=32, samples=1)
    workspace = Workspace.new(
        Editor(StudioSettings(render=render, width=1000, height=660)), Path(sys.argv[1])
    )
    pill = limb(np.array([[0.0, 0.0], [0.0, 0.6]]), np.array([0.08, 0.05]))
    shapes = [shape_from_stroke(np.add(pill, [x, 0.7]), id=name) for x, name in ((-0.4, "one"), (0.4, "two"))]
    stream = PoseStream("swing", np.tile(np.eye(3), (2, 4, 1, 1)), np.zeros((2, 4, 3)), 1.0)
    beside = np.add(shapes[0].mesh.vertices, [1.6, 0.0, 0.0])
    cage = cage_of(Mesh(beside, shapes[0].mesh.faces), "post", (Swing("swing"),))
    workspace.store.new(workspace.editor.project.with_streams(stream).with_characters(*shapes, cage))
    window = StudioWindow(workspace)

    def after(window: StudioWindow) -> None:
        if window.pictures == 2:
            report["spread"] = float(window.pixels().std())

    with coarse_pixels(lambda: window.pictures < 3):
        window.run(seconds=300, after=after, register_tests=scripted(lambda ctx: work(ctx, window)))
    report["over"] = workspace.ended
    report["left"] = [path.name for path in Path(sys.argv[1]).iterdir()]
    print(json.dumps(report))


if __name__ == "__main__":
    main()
