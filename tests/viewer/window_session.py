"""Opens the Play window on a moving box, presses keys, and prints the results as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import msgspec
import numpy as np
from deeds import scripted
from imgui_bundle import imgui

from enliven.document.character import Character, Pose, SkinWeights
from enliven.person.body import Body
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.playback.document import Document, EdgeState
from enliven_viewer.playback.timeline import NS_PER_S
from enliven_viewer.settings import RenderSettings, WindowStart
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

PRESSED = ["p", "_3", "b", "j", "e", "r", "g", "s", "space", "left_arrow", "up_arrow", "f", "f1"]


class Feed:
    """A feed of a box that moves slightly with every poll. With ``empty``, an edge that never connects."""

    def __init__(self, empty: bool) -> None:
        corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
        faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]], np.int32)
        skin = SkinWeights(np.zeros((8, 4), np.uint16), np.tile(np.float32([1, 0, 0, 0]), (8, 1)))
        pivots, edges = np.zeros((1, 3), np.float32), np.zeros((0, 2), np.int32)
        self.box = Character("box", corners, faces, skin, pivots, edges)
        self.empty, self.count, self.asked = empty, 0, []

    def poll(self, document: Document) -> int:
        document.edge = EdgeState(not self.empty, "tcp://127.0.0.1:5580", "" if self.empty else "tracking")
        if self.empty:
            return 0
        document.add_character(self.box)
        rest = self.box.rest_pose(self.count * NS_PER_S // 30)
        moved = rest.positions + np.float32([0.01 * self.count, 0, 0])
        document.add_pose(Pose("box", rest.time_ns, rest.linear, moved))
        document.add_bodies(rest.time_ns, [Body(7, np.ones((20, 3)), np.ones(20))])
        self.count += 1
        return 1

    def ask(self, order, then=None) -> None:
        self.asked.append([type(order).__name__.lower(), *msgspec.structs.astuple(order)])

    def close(self) -> None: ...


def main() -> None:
    feed, report = Feed("empty" in sys.argv), {"frames": 0, "errors": []}
    render = RenderSettings(shadow_size=64, contact_size=32)
    settings = StudioSettings(render=render, width=640, height=480)
    workspace = Workspace.new(Editor(settings), Path(sys.argv[1]))
    live = workspace.state(PerformSession).live = LiveStage(feed, Document())
    workspace.state(PerformSession).active_workspace = "Play"
    window = StudioWindow(workspace, opening=WindowStart(bare="bare" in sys.argv, escape_ends=True))

    def after(window: StudioWindow) -> None:
        report["frames"] += 1
        if window.gl_error != "GL_NO_ERROR":
            report["errors"].append(report["frames"])
        if report["frames"] == 12:
            report["spread"], report["notice"] = float(window.pixels().std()), live.empty_image_text
            report["size"] = list(window.places.viewport)

    def work(ctx: imgui.test_engine.TestContext) -> None:
        while report["frames"] < 15:
            ctx.yield_()
        for key in PRESSED:
            ctx.key_press(int(getattr(imgui.Key, key)))
            ctx.yield_()
        report["help"] = workspace.asking
        head = live.playhead
        report.update(asked=feed.asked, look=vars(live.style), live=head.live)
        report.update(paused=head.paused, speed=head.speed)
        ctx.key_press(int(imgui.Key.escape))
        ctx.yield_(3)
        ctx.key_press(int(imgui.Key.f11))
        ctx.yield_(4)
        report["full"] = list(window.places.viewport)
        ctx.key_press(int(imgui.Key.f11))
        ctx.yield_(4)
        report["again"] = list(window.places.viewport)
        ctx.key_press(int(imgui.Key.escape))

    window.run(seconds=300, after=after, register_tests=scripted(work))
    report["over"] = workspace.ended
    print(json.dumps(report))


if __name__ == "__main__":
    main()
