"""Scans a chair, steps into it, records and plays, in one window session; takes pictures of each step.

xvfb-run -a .venv/bin/python tests/viewer/sitting_session.py FOLDER CARRIED.mcap PICTURES
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

from coarse_pixels import coarse_pixels
from deeds import scripted
from imgui_bundle import ImVec2, imgui
from PIL import Image

from enliven.takes import plays
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

PATIENCE = 150.0
"""Seconds in which anything has happened: kernels may have to be compiled first."""
PAUSE = 0.05
"""Seconds between two pictures while something is waited for: each takes the processor from the edge."""
said: dict[str, object] = {"done": False, "pictures": []}
wanted: list[str] = []


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow, recording: str) -> None:
    """What an artist does."""
    workspace = window.workspace
    editor, perform, scan = workspace.editor, workspace.perform, workspace.scan

    def until(done: Callable[[], object], what: str) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            if time.monotonic() > end:
                toasts = [toast.text for toast in editor.toasts.shown]
                said["missing"] = [what, scan.said.phase, perform.standing, perform.sender.states, toasts]
                said["missing"] += [perform.meant, perform.performers, workspace.actions.recent]
                said["missing"] += [perform.live and perform.live.document.edge.message]
                raise TimeoutError(what)
            ctx.yield_()
            time.sleep(PAUSE)

    def click(name: str) -> None:
        ctx.yield_(3)
        left, top, right, bottom = workspace.widget(name)
        ctx.mouse_move_to_pos(ImVec2(min((left + right) / 2, left + 40), (top + bottom) / 2))
        ctx.mouse_click(0)
        ctx.yield_()

    def press(name: str, done: Callable[[], object]) -> None:
        """Click until it had its effect: on a busy machine the edge may be silent just then."""
        end = time.monotonic() + PATIENCE
        while not done() and time.monotonic() < end:
            click(name)
            for _ in range(15):
                if not done():
                    ctx.yield_()
                    time.sleep(PAUSE)
        until(done, name)

    def shot(name: str) -> None:
        ctx.mouse_move_to_pos(ImVec2(500, 60))
        ctx.yield_(3)
        said["pictures"].append(name)
        wanted.append(f"{len(said['pictures']):02d} {name}")
        until(lambda: not wanted, "a picture")

    shot("start page")
    click("do Stand in front of the camera")
    shot("choose a camera")
    perform.connect_nearby("--recording", recording, "--loop", "--speed", "0.7")
    until(lambda: perform.connected, "the stage")
    ctx.yield_(10)
    shot("the stage")
    click("scan")
    shot("before the scan")
    click("scan size")
    ctx.yield_(2)
    click("scan room")
    press("scan start", lambda: scan.active)
    until(lambda: scan.said.fused > 3 and scan.surface, "a surface")
    shot("the scan begins")
    until(lambda: scan.said.fused > 12, "more of it")
    shot("the scan grows")
    until(lambda: scan.said.fused > 26, "the rest")
    shot("the scan is nearly round")
    press("scan done", lambda: scan.said.phase in ("finishing", "done"))
    shot("it becomes a character")
    until(lambda: "scan" in perform.standing and not scan.shown, "it on the stage")
    ctx.yield_(10)
    shot("it stands on the stage")
    click("leave")
    ctx.yield_(5)
    shot("left the camera")
    click("recorded person")
    until(lambda: perform.connected and perform.performers, "a performer")
    ctx.yield_(10)
    shot("a performer is there")
    until(lambda: "scan" in perform.standing, "the scan on the performer's stage")
    shot("the scan beside the performer")
    press("possess", lambda: perform.holders)
    said["words"] = [one.words for one in perform.holders]
    ctx.yield_(10)
    shot("in the scan")
    click("record")
    until(lambda: perform.recording.counted == 2, "the count-in")
    shot("three, two, one")
    until(lambda: perform.recording.recorder.seconds > 2.0, "a recording")
    shot("recording")
    until(lambda: perform.recording.recorder.seconds > 4.0, "enough of it")
    click("record")
    until(lambda: perform.recording.phase == "idle", "the end of the recording")
    one = editor.project.graphs["scan"]
    said["moves"] = plays(editor.project, one)
    said["characters"] = sorted(editor.project.characters)
    shot("it plays at once")
    click("room Play")
    ctx.yield_(5)
    shot("play")
    click("room Animate")
    ctx.yield_(5)
    said["playing"] = editor.playing
    shot("animate")
    said["done"] = True
    workspace.store.forget()
    window.close()


def main() -> None:
    folder, pictures = Path(sys.argv[1]), Path(sys.argv[3])
    os.chdir(folder)
    settings = StudioSettings(render=RenderSettings(), width=1360, height=820)
    workspace = Workspace.new(Editor(settings), folder / "own")
    workspace.starting = True
    window = StudioWindow(workspace)

    fine = [False]

    def after(window: StudioWindow) -> None:
        was_fine, fine[0] = fine[0], bool(wanted)
        while wanted and was_fine:  # the picture in which it was wanted was begun with few pixels
            Image.fromarray(window.pixels()).save(pictures / f"{wanted.pop()}.png")
        if "missing" in said:
            workspace.store.forget()
            window.close()

    with coarse_pixels(lambda: bool(wanted)):
        window.run(
            seconds=570, after=after, register_tests=scripted(lambda ctx: work(ctx, window, sys.argv[2]))
        )
    print(json.dumps(said, default=str))


if __name__ == "__main__":
    main()
