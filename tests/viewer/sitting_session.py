"""Scans, possesses, records, speaks and plays with loose boxes in a single window session.

xvfb-run -a .venv/bin/python tests/viewer/sitting_session.py FOLDER DEPTH.mcap EDGE.toml [FOLDER OF PICTURES]
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from deeds import scripted
from imgui_bundle import ImVec2, imgui
from PIL import Image

from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.scan.session import ScanSession
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

PATIENCE = 150.0
"""Timeout in seconds, including compilation of the kernels."""
PAUSE = 0.05
"""Seconds between two frames while waiting. Each frame takes processor time from the edge."""
AWAY = (300.0, 330.0)
"""A position over the image, in pixels, at which the pointer shows no tooltip."""
FALLEN_M = 0.12
"""Minimum drop of a tower's box that was knocked over, metres: most of its height."""
FUSED = 42 if len(sys.argv) > 4 else 8
"""Sufficient number of fused images of the chair: most of a round if images are written, otherwise a part."""
report: dict[str, object] = {"done": False}
wanted: list[str] = []


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow, depth: str, settings: str) -> None:
    """Plays an artist's actions and spoken commands."""
    workspace = window.workspace
    editor, perform, scan = workspace.editor, workspace.state(PerformSession), workspace.state(ScanSession)
    voice, physics = perform.voice, perform.physics
    places = list[tuple[float, ...]]()

    def until(done: Callable[[], object], what: str, ask: Callable[[], object] = bool) -> None:
        end, asked = time.monotonic() + PATIENCE, 0.0
        while not done():
            if time.monotonic() > end:
                state = [
                    scan.message.phase,
                    scan.message.note,
                    voice.status,
                    physics.state_text,
                    perform.stage_ids,
                ]
                state += [perform.connected, perform.holders, perform.performers]
                report["missing"] = [what, state, [toast.text for toast in editor.toasts.shown]]
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

    def shot(name: str, *, at_once: bool = False) -> None:
        if not at_once:
            ctx.mouse_move_to_pos(ImVec2(*AWAY))
            ctx.yield_(3)
        wanted.append(name)
        until(lambda: not wanted, "a picture")

    def possess() -> None:
        # A single press is enough, with or without a person in view: the window acts as soon as possible.
        until(lambda: not perform.performers, "a moment in which nobody is in view")
        click("possess")
        report["waits"] = perform.possession_requests.words
        shot("7 waits for somebody")
        until(lambda: "scan" in {holder.character for holder in perform.holders}, "who holds the scan")
        report["held"] = [holder.description for holder in perform.holders]
        shot("8 possessed")

    def record() -> None:
        until(lambda: perform.performers, "the performer who moves")
        click("record")
        until(lambda: perform.recording.beat, "the count-in")
        shot("9 counting in", at_once=True)
        until(lambda: perform.recording.recorder.seconds > 3.0, "a recording")
        shot("10 recording")
        if perform.recording.phase != "idle":
            click("record")
        until(lambda: perform.recording.phase == "idle", "the end of the recording")
        project = editor.project
        report["recorded"] = [len(project.bodies) + len(project.takes), "scan" in project.graphs]
        shot("11 recorded")

    def play() -> None:
        click("room Animate")
        editor.scrub(0.0)
        ctx.key_press(int(imgui.Key.space))
        until(lambda: editor.playing and editor.time > 1.0, "what was recorded, as it plays")
        positions = [editor.stage_character("scan").pose.positions]
        shot("12 plays")
        positions.append(editor.stage_character("scan").pose.positions)
        report["moves"] = float(np.abs(positions[1] - positions[0]).max())
        ctx.key_press(int(imgui.Key.space))
        click("room Perform")

    click("room Perform")
    shot("1 no stage")
    perform.connect_local("--recording", depth, "--loop", "--settings", settings)
    until(lambda: perform.connected and voice.state and physics.state, "the stage")
    until(lambda: perform.performers, "a performer")
    report["phrases"] = len(voice.phrases)
    until(lambda: voice.is_understood and voice.heard_words, "a phrase that is understood")
    report["heard"] = voice.heard_words
    shot("2 heard")
    until(lambda: voice.heard_words.startswith("Not understood"), "other speech")
    report["not understood"] = voice.heard_words
    shot("3 not understood")
    click("voice phrases")
    shot("4 phrases")
    ctx.key_press(int(imgui.Key.escape))
    workspace.actions.do("scan.open")
    until(lambda: perform.performers, "the performer once more")
    until(lambda: not perform.performers, "the camera that is carried about")
    scan.size = "room"  # larger voxels, so that a busy machine keeps up with the camera
    until(lambda: scan.active, "a scan", lambda: workspace.actions.do("scan.start"))
    until(lambda: scan.message.fused > FUSED and scan.surface, "a surface")
    shot("5 scanning")
    until(
        lambda: scan.message.phase in ("finishing", "done"),
        "the end",
        lambda: workspace.actions.do("scan.done"),
    )
    until(
        lambda: "scan" in editor.project.characters and "scan" in perform.stage_ids, "the scan on the stage"
    )
    shot("6 scan stands")
    click("remove chair")
    until(lambda: "chair" not in perform.stage_ids, "a stage with the scan alone")
    editor.select_only("scan")
    report["before"] = physics.state_text
    possess()
    record()
    play()
    workspace.actions.do("perform.physics_towers_of_boxes")
    until(lambda: physics.state.state == "on", "the physics")
    until(lambda: perform.scene.props is not None and len(perform.scene.props.shapes), "the boxes")
    report["boxes"] = len(perform.scene.props.shapes)
    high = perform.scene.props.positions[:, 1].copy()
    shot("13 towers")
    until(lambda: float((high - perform.scene.props.positions[:, 1]).max()) > FALLEN_M, "boxes that fall")
    shot("14 knocked over")
    workspace.actions.do("perform.physics_nothing_loose")
    until(lambda: not perform.scene.props or not len(perform.scene.props.shapes), "an empty floor")
    workspace.actions.do("perform.open_the_microphone_or_close_it")
    until(lambda: voice.state.state == "off", "a closed microphone")
    shot("15 microphone closed")
    report["possess moved"] = sorted({round(place[1]) for place in places})
    report["instances"] = perform.client.edges[0].instance is not None
    report["done"] = True
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
        if "missing" in report:
            workspace.store.forget()
            window.close()

    script = scripted(lambda ctx: work(ctx, window, sys.argv[2], sys.argv[3]))
    window.run(seconds=1200 if large else 900, after=after, register_tests=script)
    print(json.dumps(report, default=str))


if __name__ == "__main__":
    main()
