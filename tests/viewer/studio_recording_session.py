"""Records in the real window with a real edge: slow presses, a panel without jumps, and closing the window.

Prints the results. A second argument is a folder for images.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from imgui_bundle import ImVec2, imgui
from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from coarse_pixels import coarse_pixels
from deeds import scripted
from perform_session import PATIENCE, PAUSE, RealEdge
from strokes import limb

from enliven.formats.project.one_character import project_of_mesh
from enliven.health import HealthState, Severity
from enliven.modeling.sketching.sketch import shape_from_stroke
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

HELD = 0.3
"""Seconds for which a button is pressed, as by people who aim carefully."""
SAID = "The camera sees little: the room is dark, and what is behind the performer is very near to the camera"
WRONG = tuple(
    HealthState("low frame rate", Severity.WARNING, 0, f"{SAID} ({n})", "Switch on a light. " * 6)
    for n in (1, 2)
)
STEADY = (
    "possess",
    "record",
    "performer",
    "parts",
    "join",
    "characters",
    "put",
    "scan",
    "physics",
    "count in",
)
"""Widgets whose positions are checked."""
report: dict[str, object] = {"done": False}
wanted: list[str] = []


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow, edge: RealEdge, folder: Path) -> None:
    """Plays an artist's actions."""
    workspace = window.workspace
    perform, recording = workspace.state(PerformSession), workspace.state(PerformSession).recording

    def until(done: Callable[[], object], what: str) -> None:
        report["waits for"], end = what, time.monotonic() + PATIENCE
        while not done():
            if time.monotonic() > end:
                raise TimeoutError(what)
            ctx.yield_()
            time.sleep(PAUSE)

    def aim(name: str) -> None:
        ctx.yield_(2)
        left, top, right, bottom = workspace.widget(name)
        ctx.mouse_move_to_pos(ImVec2((left + right) / 2, (top + bottom) / 2))

    def press(name: str, seconds: float = 0.0) -> None:
        aim(name)
        ctx.mouse_down(0)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            ctx.yield_()
        ctx.mouse_up(0)
        ctx.yield_(2)

    def shot(name: str) -> None:
        wanted.append(name)
        until(lambda: not wanted, "a picture")

    def places(health: tuple[HealthState, ...], message: str = "", nobody: bool = False) -> list[object]:
        """Returns the positions of the widgets while the edge reports this health."""
        document, feed = perform.live.document, perform.live.feed
        poll = feed.poll

        def told(into: object) -> int:
            count = poll(into)
            document.edge = replace(document.edge, health=health, message=message)
            if nobody:
                document.edge = replace(document.edge, signal="slow", sensor_to_pose_ms=None)
            return count

        feed.poll = told
        for name in STEADY:
            workspace.widgets.pop(name, None)
        ctx.yield_(4)
        shot(f"panel_{len(health)}_health" + "_message" * bool(message))
        del feed.poll
        return [workspace.widgets.get(name) for name in STEADY]

    press("room Perform")
    ctx.item_input_value("perform/##address", ":".join(["127.0.0.1", *edge.ports]))
    until(
        lambda: perform.holders and perform.performers and perform.stage_ids, "somebody who holds the chair"
    )
    before = places(())
    report["places"] = [
        before,
        places(WRONG[:1]),
        places(WRONG, "Too many characters"),
        places((), nobody=True),
    ]
    report["inside"] = list(window.places.side)
    report["places"] += characters_come(ctx, window, until, places)
    press("record", HELD)
    report["record"] = recording.phase
    until(lambda: recording.beat == 2, "the second beat")
    press("record", HELD)
    report["cancel"] = recording.phase
    recording.count_in = False
    press("record", HELD)
    until(lambda: recording.phase == "recording" and recording.recorder.seconds > 0.8, "a recording")
    report["moved"] = before[:2] == [workspace.widgets.get(name) for name in STEADY[:2]]
    shot("recording")
    press("record", HELD)
    report["stop"] = [recording.phase, sorted(workspace.editor.project.characters)]
    press("play", HELD)
    report["play"] = workspace.editor.playing
    report["again"] = [bool(recording.last_recording), workspace.widgets.get("record") == before[1]]
    close(ctx, window, press, until, shot, folder)
    report["done"] = True


def characters_come(ctx, window, until, places) -> list[object]:
    """Returns the widgets' positions while the user's and a visitor's character are added to the stage."""
    workspace, perform, seen = window.workspace, window.workspace.state(PerformSession), []
    pill = limb(np.array([[0.0, 0.6], [-0.05, 0.3], [-0.2, 0.0]]), np.array([0.09, 0.06, 0.045]))
    arm = shape_from_stroke(np.add(pill, [-0.8, 0.5]), id="arm")
    workspace.editor.edit("sketch", lambda project: project.with_characters(arm))
    workspace.editor.select_only("arm")
    seen.append(places(()))
    report["lines"] = [workspace.widgets["waits arm"]]
    perform.staged.put_selected()
    seen.append(places(()))
    until(lambda: "arm" in perform.stage_ids, "the arm on the stage")
    seen.append(places(()))
    report["lines"].append(workspace.widgets["stands arm"])
    visitor = project_of_mesh(workspace.editor.project.shapes["arm"].mesh, "visitor")
    perform.stage.put(visitor, "visitor", fit=True)
    until(lambda: "visitor" in perform.stage_ids, "what a visitor brings")
    seen.append(places(()))
    report["lines"].append(workspace.widgets["stands arm"])
    for name in ("visitor", "arm"):
        perform.staged.remove(name)
    until(lambda: perform.stage_ids == ("chair",), "the chair alone")
    workspace.editor.edit("remove", lambda project: project.drop_character("arm"))
    return [*seen, places(())]


def close(ctx, window, press, until, shot, folder: Path) -> None:
    """Closes the window during a recording. It asks, the recording continues, and is then saved with the
    rest.
    """
    workspace, recording = window.workspace, window.workspace.state(PerformSession).recording
    workspace.store.save(folder / "clean.enliven")
    recording.toggle()
    until(lambda: recording.phase == "recording" and recording.recorder.seconds > 0.5, "another recording")
    report["title"] = workspace.store.title
    assert not window.confirm_close()
    ctx.yield_(3)
    report["asks"] = [workspace.asking, recording.phase]
    shot("closing")
    press("dialog Cancel", HELD)
    report["goes on"] = [workspace.asking, recording.phase]
    assert not window.confirm_close()
    ctx.yield_(3)
    press("dialog Save", HELD)
    until(lambda: workspace.ended, "the end")


def main() -> None:
    folder, pictures = Path(sys.argv[1]), len(sys.argv) > 2
    edge = RealEdge(folder)
    render = RenderSettings() if pictures else RenderSettings(shadow_size=64, contact_size=32, samples=1)
    settings = StudioSettings(render=render, width=1360, height=820)
    workspace = Workspace.new(Editor(settings), folder)
    window = StudioWindow(workspace)

    def after(window: StudioWindow) -> None:
        while wanted:
            name = wanted.pop()
            if pictures:
                Image.fromarray(window.pixels()).save(Path(sys.argv[2]) / f"{name}.png")

    try:
        with coarse_pixels(lambda: pictures):
            script = scripted(lambda ctx: work(ctx, window, edge, folder))
            window.run(seconds=300, after=after, register_tests=script)
    finally:
        edge.kill()
    print(json.dumps(report, default=str))


if __name__ == "__main__":
    main()
