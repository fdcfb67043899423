"""Opens the viewer's window on a walking box, presses keys, and prints what came of it as JSON."""

from __future__ import annotations

import json
import sys

import glfw
import msgspec
import numpy as np
from enliven_viewer.live.app import App
from enliven_viewer.live.keys import KeyBindings

from enliven.document.character import Character, Pose, SkinWeights
from enliven.person.body import Body
from enliven_viewer.playback.document import Document, EdgeState
from enliven_viewer.playback.timeline import NS
from enliven_viewer.settings import RenderSettings, ViewerSettings

PRESSED = [
    glfw.KEY_P,
    glfw.KEY_3,
    glfw.KEY_B,
    glfw.KEY_J,
    glfw.KEY_E,
    glfw.KEY_R,
    glfw.KEY_H,
    glfw.KEY_G,
    glfw.KEY_S,
    glfw.KEY_SPACE,
    glfw.KEY_LEFT,
    glfw.KEY_UP,
    glfw.KEY_F,
]


class Feed:
    """A box that moves a little with every poll; with ``empty`` an edge that never comes."""

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
        rest = self.box.rest_pose(self.count * NS // 30)
        moved = rest.positions + np.float32([0.01 * self.count, 0, 0])
        document.add_pose(Pose("box", rest.time_ns, rest.linear, moved))
        document.add_bodies(rest.time_ns, [Body(7, np.ones((20, 3)), np.ones(20))])
        self.count += 1
        return 1

    def ask(self, order, then=None) -> None:
        self.asked.append([type(order).__name__.lower(), *msgspec.structs.astuple(order)])

    def close(self) -> None: ...


def main() -> None:
    feed, said = Feed("empty" in sys.argv), {"frames": 0, "sizes": [], "errors": []}
    render = RenderSettings(shadow_size=64, contact_size=32)
    app = App(feed, Document(), ViewerSettings(render=render, width=320, height=200))

    def on_frame(app: App, renderer) -> None:
        window = glfw.get_current_context()
        number = said["frames"]
        said["frames"] += 1
        if renderer.ctx.error != "GL_NO_ERROR":
            said["errors"].append(number)
        said["sizes"] = list(renderer.size)
        said["spread"] = float(renderer.pixels().std())
        said["notice"] = app._notice()
        if number < len(PRESSED):
            glfw.set_key_callback(window, keys := glfw.set_key_callback(window, None))
            keys(window, PRESSED[number], 0, glfw.PRESS, 0)
        elif number == len(PRESSED):
            glfw.set_window_size(window, 400, 260)
        elif number == len(PRESSED) + 10:
            glfw.set_window_should_close(window, True)

    app.run(60, on_frame, KeyBindings)
    head = app.playhead
    said |= {"asked": feed.asked, "help": app.help, "look": vars(app.style), "live": head.live}
    said |= {"paused": head.paused, "speed": head.speed}
    print(json.dumps(said))


if __name__ == "__main__":
    main()
