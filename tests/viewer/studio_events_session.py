"""Opens the studio's window and draws a circle within two frames through the window's own events."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import numpy as np
from imgui_bundle import imgui

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

report: dict[str, object] = {"done": False}
RADIUS, MANY = 120.0, 200


def main() -> None:
    render = RenderSettings(shadow_size=64, contact_size=32, samples=1)
    settings = StudioSettings(render=render, width=1000, height=660)
    workspace = Workspace.new(Editor(settings), Path(sys.argv[1]))
    workspace.input.activate_tool("sketch")
    window = StudioWindow(workspace)
    drawn: list[np.ndarray] = []

    def move(angle: float) -> None:
        area, desktop = window.places.viewport, window.desktop
        x = area.x + area.width / 2 + RADIUS * math.cos(angle)
        y = area.y + area.height / 2 + RADIUS * math.sin(angle)
        desktop._pointer_callbacks[0](desktop._window, x, y)

    def before(window: StudioWindow) -> None:
        if window.pictures == 5:
            move(0.0)
            imgui.get_io().add_mouse_button_event(0, True)
        elif window.pictures in (7, 8):
            half = (window.pictures - 7) * MANY // 2
            for number in range(half, half + MANY // 2):
                move(2 * math.pi * (number + 1) / MANY)
        elif window.pictures == 11:
            drawn.append(np.array(workspace.input.tool.take_points()))
            workspace.store.forget()
            window.close()

    window.run(seconds=60, before=before)
    stroke = drawn[0]
    away = np.linalg.norm(stroke - (stroke.min(0) + stroke.max(0)) / 2, axis=1)
    report.update(done=True, places=len(stroke), roundness=float(np.ptp(away) / RADIUS))
    print(json.dumps(report))


if __name__ == "__main__":
    main()
