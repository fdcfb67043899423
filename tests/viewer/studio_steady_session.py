"""Shows the start page, the Perform panel and a scan for seconds. Prints their widgets' positions as JSON.

xvfb-run -a .venv/bin/python tests/viewer/studio_steady_session.py FOLDER [FOLDER OF PICTURES]
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import msgspec
from imgui_bundle import imgui

from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.cameras import Camera
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.scan.session import ScanSession
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

PATIENCE_S = 60.0
"""Timeout in seconds for the edge's program to list its cameras on a busy machine."""
SETTLED = 2
"""Number of frames until ImGui knows the size of an auto-sized window. ImGui hides the window until then."""
FRAMES = 5
"""Number of frames for which each list of cameras is shown."""
MADE_UP = Camera("A made-up person in front of a wall, far away", "synthetic", {"width": "160"})
LACKING = Camera("OAK-D Lite", "oak", {}, "depthai is not installed", "Type: pip install enliven-edge[oak]")
NO_DRIVER = Camera(
    "Kinect", "", {}, "enliven has no driver for this camera", "Add one, as docs/add-a-sensor.md describes."
)
LISTS = ((), (MADE_UP,), (MADE_UP, LACKING, NO_DRIVER))
report: dict[str, object] = {}


def moved(frames: list[dict[str, tuple[float, ...]]]) -> dict[str, list[tuple[float, ...]]]:
    """Returns the widgets that had more than one position, with their positions."""
    places = dict[str, set[tuple[float, ...]]]()
    for frame in frames:
        for name, place in frame.items():
            places.setdefault(name, set()).add(tuple(round(value, 1) for value in place))
    return {name: sorted(each) for name, each in places.items() if len(each) > 1}


class Steps:
    """The shown states, one after another. The widgets of each frame are stored by the state's name."""

    def __init__(self, workspace: Workspace, pictures: Path | None) -> None:
        self.workspace, self.pictures = workspace, pictures
        self.frames = dict[str, list[dict[str, tuple[float, ...]]]]()
        self.shown, self.count, self.todo = "", 0, self.steps()
        self.goes_on = lambda: False
        self.pointer, self.pressed, self.wanted = (0.0, 0.0), False, ""

    def show(self, name: str) -> None:
        self.shown, self.count = name, 0

    def steps(self):
        """Yields True if the shown state stays."""
        workspace, search = self.workspace, self.workspace.state(PerformSession).cameras
        workspace.starting = True
        self.show("start page")
        yield lambda: self.count < 20
        workspace.starting, workspace.state(PerformSession).active_workspace = False, "Perform"
        self.show("no stage")
        end = time.monotonic() + PATIENCE_S
        yield lambda: search.cameras is None and time.monotonic() < end
        report["the edge's own list"] = [list(map(str, search.cameras or ())), search.problem]
        for cameras in LISTS:
            search.handle_search(msgspec.json.encode(cameras).decode(), False)
            self.picture(f"{len(cameras)} cameras")
            yield lambda: self.count < FRAMES
        left, top, right, bottom = workspace.widgets["look 0"]
        self.pointer = (left + right) / 2, (top + bottom) / 2
        yield lambda: self.count < FRAMES + 2
        self.pressed, self.count = True, 0
        yield lambda: self.count < 2
        self.pressed = False
        yield lambda: search.test_result is None and time.monotonic() < end + PATIENCE_S
        report["looked"] = [
            str(search.test_result and search.test_result[1]),
            "camera view" in workspace.widgets,
        ]
        self.picture("look")
        yield lambda: self.count < FRAMES
        search.begin()
        self.picture("searching again")
        yield lambda: self.count < FRAMES
        search.handle_search("nothing", True)
        self.picture("problem")
        yield lambda: self.count < FRAMES
        workspace.state(ScanSession).is_shown = True
        self.show("a scan")
        self.picture("scan")
        yield lambda: self.count < FRAMES

    def picture(self, name: str) -> None:
        self.wanted, self.count = name, 0

    def before(self, window: StudioWindow) -> None:
        if window.desktop is None:
            return
        if not self.goes_on():
            self.goes_on = next(self.todo, None)
            if self.goes_on is None:
                self.goes_on = bool
                self.workspace.store.forget()
                window.close()
        io = imgui.get_io()
        io.add_mouse_pos_event(*self.pointer)
        if self.pressed != io.mouse_down[0]:
            io.add_mouse_button_event(0, self.pressed)
        self.workspace.widgets.clear()

    def after(self, window: StudioWindow) -> None:
        if window.desktop is None:
            return
        self.count += 1
        frames = self.frames.setdefault(self.shown, [])
        frames.append(dict(self.workspace.widgets))
        if self.pictures is not None and self.count == FRAMES - 1 and self.wanted:
            from PIL import Image

            Image.fromarray(window.pixels()).save(self.pictures / f"{self.wanted}.png")
            self.wanted = ""


def main() -> None:
    pictures = Path(sys.argv[2]) if len(sys.argv) > 2 else None
    small = RenderSettings(shadow_size=64, contact_size=32, samples=1)
    settings = StudioSettings(render=RenderSettings() if pictures else small, width=1360, height=820)
    workspace = Workspace.new(Editor(settings), Path(sys.argv[1]))
    going = Steps(workspace, pictures)
    StudioWindow(workspace).run(seconds=200, before=going.before, after=going.after)
    for name, frames in going.frames.items():
        names = set().union(*frames)
        report[name] = {"frames": len(frames), "widgets": sorted(names), "moved": moved(frames[SETTLED:])}
        report[name]["seen"] = sorted(widget for widget in names if widget[-1:].isdigit())
    print(json.dumps(report))


if __name__ == "__main__":
    main()
