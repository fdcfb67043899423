"""Opens the studio's window with a feature of another package and uses it. Prints the results as JSON.

Arguments: a folder for preferences, and optionally a folder for images. The feature must be installed.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from deeds import by_key, by_menu, scripted
from gauge_feature import COLOUR, Gauge
from imgui_bundle import ImVec2, imgui
from PIL import Image

from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

report: dict[str, object] = {"done": False}
wanted: list[str] = []


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> None:
    """Shows and hides the gauge by its menu, key, panel and tool."""
    workspace = window.workspace
    gauge, action = workspace.state(Gauge), workspace.actions["gauge.show"]

    def look(name: str) -> None:
        workspace.widgets.clear()
        ctx.yield_(3)
        wanted.append(name)
        while wanted:
            ctx.yield_()

    def click(name: str) -> None:
        left, top, right, bottom = workspace.widget(name)
        ctx.mouse_move_to_pos(ImVec2((left + right) / 2, (top + bottom) / 2))
        ctx.mouse_click(0)
        ctx.yield_(2)

    look("before")
    by_menu(ctx, action)
    look("by menu")
    click("gauge back")
    look("closed")
    by_key(ctx, action)
    workspace.state(PerformSession).active_workspace = "Perform"
    look("Perform")
    workspace.state(PerformSession).active_workspace = "Model"
    look("Model")
    click("tool gauge")
    report["tool"], report["frames"] = workspace.input.tool.name, gauge.frames > 10
    report["done"] = True
    workspace.store.forget()
    window.close()


def main() -> None:
    pictures = Path(sys.argv[2]) if len(sys.argv) > 2 else None
    render = RenderSettings() if pictures else RenderSettings(shadow_size=64, contact_size=32, samples=1)
    workspace = Workspace.new(Editor(StudioSettings(render=render, width=900, height=640)), Path(sys.argv[1]))
    report["complaints"] = [toast.text for toast in workspace.editor.toasts.shown]

    def after(window: StudioWindow) -> None:
        while wanted:
            name, pixels = wanted.pop(), window.pixels()
            marked = int((pixels == np.array(COLOUR, np.uint8)).all(2).sum())
            report[name] = ["gauge back" in workspace.widgets, marked]
            if pictures:
                Image.fromarray(pixels).save(pictures / f"{name}.png")

    window = StudioWindow(workspace)
    window.run(seconds=300, after=after, register_tests=scripted(lambda ctx: work(ctx, window)))
    print(json.dumps(report))


if __name__ == "__main__":
    main()
