"""Scans in the real window with a real edge that replays a carried camera. Prints the results.

xvfb-run -a .venv/bin/python tests/viewer/scan_session.py FOLDER CARRIED.mcap [FOLDER OF PICTURES]
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from coarse_pixels import coarse_pixels
from deeds import scripted
from imgui_bundle import ImVec2, imgui
from PIL import Image

from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.scan.advice import choose_advice
from enliven_viewer.studio.features.scan.session import ScanSession
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

PATIENCE = 150.0
"""Timeout in seconds, including compilation of the kernels."""
PAUSE = 0.05
"""Seconds between two frames while waiting. Each frame takes processor time from the edge."""
report: dict[str, object] = {"done": False}
wanted: list[str] = []


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow, recording: str) -> None:
    """Plays an artist's actions."""
    workspace = window.workspace
    editor, perform, scan = workspace.editor, workspace.state(PerformSession), workspace.state(ScanSession)
    places = set[tuple[int, ...]]()

    def until(done: Callable[[], object], what: str) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            if time.monotonic() > end:
                state = [
                    scan.message.phase,
                    scan.message.note,
                    scan.message.remedy,
                    scan.message.tracking,
                    scan.message.fused,
                ]
                report["missing"] = [what, state, [toast.text for toast in editor.toasts.shown]]
                raise TimeoutError(what)
            ctx.yield_()
            watch()
            time.sleep(PAUSE)

    def watch() -> None:
        """Stores the positions of a scan's buttons in the last frame."""
        names = ("scan progress", "scan pause", "scan undo", "scan keep box", "scan done", "scan cancel")
        widgets = [workspace.widgets.get(name) for name in names]
        if scan.active and not scan.has_crop_box and all(widgets):
            top = widgets[0][1]  # scrolled widgets move together
            tops = [round(widget[1] - top * (number < 4)) for number, widget in enumerate(widgets)]
            places.add(tuple(tops))

    def click(name: str) -> None:
        until(lambda: not scan.describe_missing_stage(), "an edge that is heard")
        workspace.drawn.set_targets((name,))
        ctx.yield_(3)
        workspace.drawn.set_targets(())
        left, top, right, bottom = workspace.widget(name)
        ctx.mouse_move_to_pos(ImVec2(min((left + right) / 2, left + 40), (top + bottom) / 2))
        ctx.mouse_click(0)
        ctx.yield_()

    def press(name: str, done: Callable[[], object]) -> None:
        """Clicks until ``done`` is true, because an edge on a busy machine may be silent."""
        end = time.monotonic() + PATIENCE
        while not done() and time.monotonic() < end:
            click(name)
            for _ in range(20):
                if not done():
                    ctx.yield_()
                    time.sleep(PAUSE)
        until(done, name)

    def shot(name: str) -> None:
        ctx.yield_(2)
        wanted.append(name)
        until(lambda: not wanted, "a picture")

    def drag_the_top(area: Area) -> None:
        """Drags the dot at the top of the box down, less far if a slow machine has made only a small box."""
        dots = np.array([scan.box.find_handle(end, 1) for end in (1, 0)])
        (x, y), (_, bottom) = editor.lens.project_visible(dots)
        ctx.mouse_move_to_pos(ImVec2(area.x + x, area.y + y))
        ctx.mouse_down(0)
        ctx.yield_()
        ctx.mouse_move_to_pos(ImVec2(area.x + x, area.y + y + min(16.0, 0.15 * (bottom - y))))
        ctx.yield_()
        ctx.mouse_up(0)
        ctx.yield_()

    def drag_the_box() -> None:
        """Drags the dot at the top of the box down with the mouse, twice."""
        press("scan keep box", lambda: scan.has_crop_box)
        views: list[np.ndarray] = []

        def still() -> bool:
            views.append(editor.lens.view.camera_from_world.copy())
            return len(views) > 4 and bool((views[-1] == views[-4]).all())

        until(still, "the end of the view's way")
        eye = views[-1]
        shot("box")
        area = window.places.viewport
        before: np.ndarray | None = None
        for drag in range(2):  # First the dot of the top, then the dot of the resulting box.
            top = scan.box.corners[1, 1]
            for _ in range(3):  # A busy window may miss a press.
                if scan.box.corners[1, 1] == top:
                    # Until it is dragged, the box follows the growing surface.
                    before = scan.box.corners.copy() if drag == 0 else before
                    drag_the_top(area)
        assert before is not None
        report["dragged"] = [before.tolist(), scan.box.corners.tolist()]
        report["view kept"] = bool((eye == editor.lens.view.camera_from_world).all())
        shot("dragged")

    report["lacks"] = workspace.actions["scan.start"].why_not()
    workspace.actions.do("scan.open")
    shot("before")
    words = ("--recording", recording, "--loop", "--speed", "0.7")
    perform.connect_local(*words)
    until(lambda: perform.connected and perform.stage_ids, "the stage")
    shot("ready")
    click("scan size")
    ctx.yield_(2)
    click("scan room")
    report["size"] = scan.size
    press("scan start", lambda: scan.active)
    until(lambda: scan.message.fused > 3 and scan.surface, "a surface")
    shot("begun")
    first = len(scan.surface[0].faces)
    until(lambda: scan.message.undoable and scan.message.fused > 16 and scan.message.view, "more of it")
    until(lambda: len(scan.surface[0].faces) > 1.5 * first, "its surface")
    report["grown"] = [first, len(scan.surface[0].faces)]
    report["words"] = choose_advice(scan.message).text
    shot("growing")
    press("scan pause", lambda: scan.message.phase == "paused")
    shot("paused")
    before = scan.message.fused
    press("scan undo", lambda: scan.message.fused < before)
    report["undone"] = [before, scan.message.fused]
    drag_the_box()
    press("scan pause", lambda: scan.message.phase == "scanning")
    until(lambda: scan.message.fused > 26, "the rest")
    shot("round")
    press("scan done", lambda: scan.message.phase in ("finishing", "done"))
    shot("making")
    until(lambda: "scan" in editor.project.characters, "the character")
    until(lambda: "scan" in perform.stage_ids and not scan.is_shown, "it on the stage")
    ctx.yield_(20)
    character = editor.project.characters["scan"]
    report["scanned"] = [len(character.mesh.faces), np.ptp(character.mesh.vertices, axis=0).round(2).tolist()]
    report["chosen"] = [
        editor.selection.character,
        editor.history.undo_name,
        character.mesh.colours is not None,
    ]
    shot("done")
    ctx.key_press(int(imgui.Key.mod_ctrl) | int(imgui.Key.z))
    ctx.yield_()
    report["undone edit"] = sorted(editor.project.characters)
    ctx.key_press(int(imgui.Key.mod_ctrl) | int(imgui.Key.mod_shift) | int(imgui.Key.z))
    ctx.yield_()
    fused = scan.message.fused
    workspace.actions.do("scan.again")
    until(
        lambda: scan.message.phase == "scanning" and scan.message.fused > fused + 5, "more of the same thing"
    )
    workspace.actions.do("scan.done")
    until(lambda: editor.history.undo_name == "add to the scan scan", "the second making")
    report["again"] = [sorted(editor.project.characters), scan.message.fused > fused + 5]
    report["places"] = list(places)
    report["done"] = True
    workspace.store.forget()
    window.close()


def main() -> None:
    folder = Path(sys.argv[1])
    large = len(sys.argv) > 3
    render = RenderSettings() if large else RenderSettings(shadow_size=64, contact_size=32, samples=1)
    settings = StudioSettings(render=render, width=1280 if large else 760, height=760 if large else 640)
    workspace = Workspace.new(Editor(settings), folder)
    window = StudioWindow(workspace)

    def after(window: StudioWindow) -> None:
        while wanted:
            name = wanted.pop()
            if large:
                Image.fromarray(window.pixels()).save(Path(sys.argv[3]) / f"{name}.png")
        if "missing" in report:
            workspace.store.forget()
            window.close()

    with coarse_pixels(lambda: large):
        script = scripted(lambda ctx: work(ctx, window, sys.argv[2]))
        window.run(seconds=570, after=after, register_tests=script)
    print(json.dumps(report, default=str))


if __name__ == "__main__":
    main()
