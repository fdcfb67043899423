"""Saves a project in the real window after another program has changed the file.

A second argument is a folder for images.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from coarse_pixels import coarse_pixels
from deeds import press, scripted
from imgui_bundle import ImVec2, imgui
from PIL import Image

from enliven.document.project import Project
from enliven.document.rigged import still_shape
from enliven.document.skeleton import Skeleton
from enliven.formats.project.file import read_project, write_project
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

report: dict[str, object] = {"done": False}
wanted: list[str] = []


def bone(name: str):
    places = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    return still_shape(name, Skeleton(("a", "b"), np.array([-1, 0], np.int32), places))


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow, path: Path) -> None:
    """Saves, cancels, saves again, compares, merges the changes, and overwrites the file."""
    workspace, asked = window.workspace, list[str]()

    def click(name: str) -> None:
        ctx.yield_(3)
        left, top, right, bottom = workspace.widget(f"dialog {name}")
        ctx.mouse_move_to_pos(ImVec2((left + right) / 2, (top + bottom) / 2))
        ctx.mouse_click(0)
        ctx.yield_(2)

    def shot(name: str) -> None:
        ctx.yield_(2)
        wanted.append(name)
        while wanted:
            ctx.yield_()

    ctx.yield_(5)
    press(ctx, "ctrl+s")
    asked.append(workspace.asking)
    shot("changed")
    click("Cancel")
    asked.append(workspace.asking)
    press(ctx, "ctrl+s")
    asked.append(workspace.asking)
    click("Compare")
    report["asked"], report["compared"] = asked, [difference.item for difference in workspace.compared]
    shot("compared")
    click("Add the items that are only in the file")
    click("Overwrite")
    report["done"] = not workspace.store.dirty
    window.close()


def main() -> None:
    folder, pictures = Path(sys.argv[1]), len(sys.argv) > 2
    render = RenderSettings() if pictures else RenderSettings(shadow_size=64, contact_size=32, samples=1)
    workspace = Workspace.new(Editor(StudioSettings(render=render, width=1000, height=640)), folder / "own")
    path = folder / "work.enliven"
    workspace.store.new(Project())
    workspace.store.save(path)
    write_project(path, read_project(path).with_characters(bone("theirs")))
    workspace.editor.edit("add", lambda project: project.with_characters(bone("mine")))
    window = StudioWindow(workspace)

    def after(window: StudioWindow) -> None:
        while wanted:
            name = wanted.pop()
            if pictures:
                Image.fromarray(window.pixels()).save(Path(sys.argv[2]) / f"{name}.png")

    with coarse_pixels(lambda: pictures):
        script = scripted(lambda ctx: work(ctx, window, path))
        window.run(seconds=120, after=after, register_tests=script)
    print(json.dumps(report, default=str))


if __name__ == "__main__":
    main()
