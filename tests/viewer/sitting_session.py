"""Scans, steps in, records, speaks and plays with loose boxes in one window that nothing restarts.

xvfb-run -a .venv/bin/python tests/viewer/sitting_session.py FOLDER DEPTH.mcap EDGE.toml [FOLDER OF PICTURES]
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

from deeds import scripted
from imgui_bundle import ImVec2, imgui
from PIL import Image

from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

PATIENCE = 150.0
"""Seconds in which anything has happened: kernels may have to be compiled first."""
PAUSE = 0.05
"""Seconds between two pictures while something is waited for: each takes the processor from the edge."""
said: dict[str, object] = {"done": False}
wanted: list[str] = []


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow, depth: str, settings: str) -> None:
    """Do and say what an artist does and says."""
    workspace = window.workspace
    editor, perform, scan = workspace.editor, workspace.perform, workspace.scan
    voice, physics = perform.voice, perform.physics
    places = list[tuple[float, ...]]()

    def until(done: Callable[[], object], what: str, ask: Callable[[], object] = bool) -> None:
        end, asked = time.monotonic() + PATIENCE, 0.0
        while not done():
            if time.monotonic() > end:
                told = [scan.said.phase, scan.said.note, voice.status, physics.words, perform.standing]
                told += [perform.connected, perform.holders, perform.performers]
                said["missing"] = [what, told, [toast.text for toast in editor.toasts.shown]]
                raise TimeoutError(what)
            if time.monotonic() - asked > 5.0:
                ask()
                asked = time.monotonic()
            ctx.yield_()
            if "possess" in workspace.widgets and perform.live is not None:
                places.append(workspace.widgets["possess"])
            time.sleep(PAUSE)

    def click(name: str) -> None:
        ctx.yield_(2)
        left, top, right, bottom = workspace.widget(name)
        ctx.mouse_move_to_pos(ImVec2(min((left + right) / 2, left + 20), (top + bottom) / 2))
        ctx.mouse_click(0)
        ctx.yield_()

    def shot(name: str) -> None:
        ctx.yield_(2)
        wanted.append(name)
        until(lambda: not wanted, "a picture")

    click("room Perform")
    shot("1 no stage")
    perform.connect_nearby("--recording", depth, "--loop", "--settings", settings)
    until(lambda: perform.connected and voice.state and physics.state, "the stage")
    until(lambda: perform.performers, "a performer")
    said["phrases"] = len(voice.phrases)
    until(lambda: voice.is_understood and voice.words, "a phrase that is understood")
    said["heard"] = voice.words
    shot("2 heard")
    until(lambda: voice.words.startswith("Not understood"), "other speech")
    said["not understood"] = voice.words
    shot("3 not understood")
    click("voice phrases")
    shot("4 phrases")
    ctx.key_press(int(imgui.Key.escape))
    workspace.actions.do("scan.open")
    until(lambda: perform.performers, "the performer once more")
    until(lambda: not perform.performers, "the camera that is carried about")
    until(lambda: scan.active, "a scan", lambda: workspace.actions.do("scan.start"))
    until(lambda: scan.said.fused > 5 and scan.surface, "a surface")
    shot("5 scanning")
    until(
        lambda: scan.said.phase in ("finishing", "done"), "the end", lambda: workspace.actions.do("scan.done")
    )
    until(lambda: "scan" in editor.project.characters and "scan" in perform.standing, "the scan on the stage")
    click("room Perform")
    editor.choose("scan")
    until(lambda: perform.meant == "scan", "the scan that is meant")
    until(lambda: perform.performers, "the performer again")
    holds = lambda: "scan" in {one.character for one in perform.holders}  # noqa: E731
    until(holds, "who holds the scan", lambda: perform.performers and click("possess"))
    said["held"] = [one.words for one in perform.holders]
    shot("6 possessed")
    said["before"] = physics.words
    workspace.actions.do("perform.physics_towers_of_boxes")
    until(lambda: physics.state.state == "on", "the physics")
    until(lambda: perform.scene.props is not None and len(perform.scene.props.shapes), "the boxes")
    said["boxes"] = len(perform.scene.props.shapes)
    shot("7 physics")
    perform.recording.count_in = False
    until(
        lambda: perform.recording.recorder.seconds > 1.0,
        "a recording",
        lambda: click("record") if perform.recording.phase == "idle" and holds() else None,
    )
    shot("8 recording")
    if perform.recording.phase != "idle":
        perform.recording.record()
    said["recorded"] = [
        len(editor.project.bodies) + len(editor.project.takes),
        "scan" in editor.project.graphs,
    ]
    workspace.actions.do("perform.physics_nothing_loose")
    until(lambda: not len(perform.scene.props.shapes), "an empty floor")
    workspace.actions.do("perform.open_the_microphone_or_close_it")
    until(lambda: voice.state.state == "off", "a closed microphone")
    shot("9 muted")
    said["possess moved"] = sorted({round(one[1]) for one in places})
    said["instances"] = perform.client.edges[0].instance is not None
    said["done"] = True
    workspace.store.forget()
    window.close()


def main() -> None:
    folder, large = Path(sys.argv[1]), len(sys.argv) > 4
    render = RenderSettings() if large else RenderSettings(shadow_size=64, contact_size=32, samples=1)
    settings = StudioSettings(render=render, width=1360, height=820)
    workspace = Workspace.new(Editor(settings), folder)
    window = StudioWindow(workspace)

    def after(window: StudioWindow) -> None:
        while wanted:
            name = wanted.pop()
            if large:
                Image.fromarray(window.pixels()).save(Path(sys.argv[4]) / f"{name}.png")
        if "missing" in said:
            workspace.store.forget()
            window.close()

    script = scripted(lambda ctx: work(ctx, window, sys.argv[2], sys.argv[3]))
    window.run(seconds=500, after=after, register_tests=script)
    print(json.dumps(said, default=str))


if __name__ == "__main__":
    main()
