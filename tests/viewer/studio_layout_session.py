"""Opens the studio once and shows workspaces at several window and text sizes. Prints cut or overlapping
letters as JSON.

Arguments: a folder for preferences, and optionally a folder for images.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import glfw
import numpy as np
from imgui_bundle import imgui
from imgui_bundle.glfw_utils import glfw_window_hello_imgui

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from drawn_text import Letters, cut_letters, drawn_letters, overlapping_letters
from made_acting_stage import acting_stage

from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.scan.session import ScanSession
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

SIZES = {
    "600x400": (600, 400, 1.0),
    "1280x720": (1280, 720, 1.0),
    "1280x720 at 200 %": (1280, 720, 2.0),
    "3840x2160": (3840, 2160, 1.0),
}
PAGES = {"600x400": (600, 400, 1.0), "1000x640 at 200 %": (1000, 640, 2.0)}
"""Small windows for the start page, which has more lines than fit: width, height, text scale."""
SMALL = ("600x400", "1280x720 at 200 %")
FRAMED, SETTLED = 4, 6
"""Number of frames until a window has its new size, and until ImGui has laid out its contents."""
ROOMS = ("Perform", "Animate", "Model")
report: dict[str, dict] = {}


def enter(workspace: Workspace, room: str, *, chosen: str | None = None, tool: str = "choose") -> None:
    """Shows a workspace with a character and a tool."""
    workspace.state(PerformSession).active_workspace, workspace.state(ScanSession).is_shown = room, False
    workspace.input.activate_tool(tool)
    workspace.editor.select_only(chosen)


def scan(workspace: Workspace) -> None:
    """Shows the scan panel."""
    enter(workspace, "Perform")
    workspace.state(ScanSession).open()


def start_page(workspace: Workspace) -> None:
    """Shows the start page of an empty project."""
    enter(workspace, "Animate")
    workspace.store.new()
    workspace.starting = True


STATES = {
    "Perform": lambda workspace: enter(workspace, "Perform"),
    "Animate": lambda workspace: enter(workspace, "Animate"),
    "Model": lambda workspace: enter(workspace, "Model"),
    "a puppet": lambda workspace: enter(workspace, "Animate", chosen="star"),
    "a motion to map": lambda workspace: enter(workspace, "Animate", chosen="limb", tool="map"),
    "a brush": lambda workspace: enter(workspace, "Model", chosen="post", tool="paint"),
    "a scan": scan,
}
"""Functions that show each state, by name. Three workspaces are tested at all sizes, the others in small
windows.
"""


def main() -> None:
    pictures = Path(sys.argv[2]) if len(sys.argv) > 2 else None
    workspace = acting_stage(Path(sys.argv[1]), 1280, 720)
    window = StudioWindow(workspace)
    sizes, states = SIZES | PAGES, STATES | {"the start page": start_page}
    shown = [(size, room) for size in SIZES for room in STATES if room in ROOMS or size in SMALL]
    shown += [(size, "the start page") for size in PAGES]
    state = {"at": 0, "since": 0}
    lists: dict[str, list[Letters]] = {}

    def before(window: StudioWindow) -> None:
        if window.desktop is None:
            return
        if state["at"] == len(shown):
            workspace.store.forget()
            window.close()
            return
        size, room = shown[state["at"]]
        wide, high, text = sizes[size]
        if state["since"] == FRAMED:
            workspace.editor.frame_all(at_once=True)
        if state["since"] == 0:
            workspace.preferences.text_size = text
            states[room](workspace)
            if glfw.get_window_size(glfw_window_hello_imgui()) != (wide, high):
                glfw.set_window_size(glfw_window_hello_imgui(), wide, high)
            workspace.widgets.clear()

    def after(window: StudioWindow) -> None:
        if window.desktop is None or state["at"] == len(shown):
            return
        state["since"] += 1
        if state["since"] < SETTLED:
            return
        size, room = shown[state["at"]]
        state.update(at=state["at"] + 1, since=0)
        name = f"{room} {size}"
        lists[name] = drawn_letters()
        io = imgui.get_io()
        area = window.places.viewport
        character = [
            point
            for posed in workspace.editor.visible_characters
            for point in workspace.editor.lens.project_visible(np.asarray(posed.extent, float))
        ] or [np.zeros(2)]
        low, high = np.min(character, axis=0), np.max(character, axis=0)
        report[name] = {
            "usual": [io.display_size.x, io.display_size.y],
            "widgets": dict(workspace.widgets),
            "picture": [area.x, area.y, area.x + area.width, area.y + area.height],
            "character": [*(low + area[:2]).tolist(), *(high + area[:2]).tolist()],
        }
        if (page := workspace.drawn.find(("start page",))) is not None:
            report[name]["widgets"]["start page"] = page[1]
        if pictures is not None:
            from PIL import Image

            Image.fromarray(window.pixels()).save(pictures / f"{name}.png")

    window.run(seconds=300, before=before, after=after)
    for name, letters in lists.items():
        report[name]["letters"] = sum(len(letter.places) for letter in letters)
        report[name]["cut"] = cut_letters(letters)
        report[name]["overlapping"] = overlapping_letters(letters)
    print(json.dumps(report))


if __name__ == "__main__":
    main()
