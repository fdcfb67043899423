"""Shows an installation's stage in full screen while its edge is lost and returns. Prints the results.

A second argument is a folder for images.
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
from imgui_bundle import imgui
from PIL import Image
from window_session import Feed

from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.playback.document import Document
from enliven_viewer.settings import RenderSettings, WindowStart
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.feature import StageOverlays
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

PATIENCE = 60.0
"""Timeout in seconds."""
report: dict[str, object] = {"done": False}
wanted: list[str] = []
pictures: dict[str, np.ndarray] = {}


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow, feed: Feed) -> None:
    """Plays the events of an installation."""
    workspace = window.workspace
    perform, loop = workspace.state(PerformSession), workspace.state(StageOverlays).idle_loop

    def until(done: Callable[[], object], what: str) -> None:
        report["waits for"], end = what, time.monotonic() + PATIENCE
        while not done():
            if time.monotonic() > end:
                raise TimeoutError(what)
            ctx.yield_()

    def shot(name: str) -> None:
        wanted.append(name)
        until(lambda: not wanted, "a picture")

    ctx.yield_(5)
    until(lambda: loop.loss == "waiting", "that nothing is there yet")
    shot("before")
    feed.empty = False
    until(lambda: perform.performers and not loop.loss, "somebody who performs")
    report["live"] = [loop.loss, perform.live.playhead.live]
    until(lambda: len(perform.live.document.timeline) > 40, "some seconds")
    shot("performing")
    report["widgets"] = sorted(workspace.widgets)
    report["area"] = [list(window.places.viewport)[:2], bool(window.places.viewport.width > 640)]
    feed.empty = True
    until(lambda: loop.loss == "away", "that it is noticed")
    report["words"] = loop.audience_text
    ctx.yield_(3)
    shot("away")
    began, seen = perform.live.playhead.time_ns, set[int]()
    until(lambda: seen.add(perform.live.playhead.time_ns) or len(seen) > 5, "a replay that goes on")
    shot("away later")
    report["moves"] = float(np.abs(pictures["away"].astype(int) - pictures["away later"]).mean())
    report["replays"] = [not perform.live.playhead.live, bool(began)]
    feed.empty = False
    until(lambda: not loop.loss, "the edge again")
    ctx.yield_(3)
    report["back"] = [loop.audience_text, perform.live.playhead.live]
    ctx.key_press(int(imgui.Key.f11))
    ctx.yield_(4)
    report["windowed"] = [window.audience, "room Play" in workspace.widgets]
    shot("windowed")
    ctx.key_press(int(imgui.Key.f11))
    ctx.yield_(4)
    workspace.widgets.clear()
    ctx.yield_(3)
    report["again"] = [window.audience, "room Play" in workspace.widgets]
    report["done"] = True
    ctx.key_press(int(imgui.Key.escape))


def main() -> None:
    folder, large = Path(sys.argv[1]), len(sys.argv) > 2
    feed = Feed(empty=True)
    render = RenderSettings() if large else RenderSettings(shadow_size=64, contact_size=32, samples=1)
    workspace = Workspace.new(Editor(StudioSettings(render=render, width=640, height=480)), folder)
    workspace.state(PerformSession).active_workspace = "Play"
    workspace.state(PerformSession).live = LiveStage(feed, Document())
    opening = WindowStart("enliven", full_screen=True, escape_ends=True, audience=True)
    window = StudioWindow(workspace, opening=opening)

    def after(window: StudioWindow) -> None:
        while wanted:
            name = wanted.pop()
            pictures[name] = window.pixels()
            if large:
                Image.fromarray(pictures[name]).save(Path(sys.argv[2]) / f"audience_{name}.png")

    with coarse_pixels(lambda: large, every=1):
        window.run(seconds=300, after=after, register_tests=scripted(lambda ctx: work(ctx, window, feed)))
    print(json.dumps(report, default=str))


if __name__ == "__main__":
    main()
