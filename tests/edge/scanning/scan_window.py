"""A window's connection to a scanning edge, without rendering."""

import time

from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.scan.session import ScanSession

ASKED_EVERY = 20.0
"""Seconds between two scan requests, enough for a busy link to recover."""


class Window:
    """A window's connection to the edge: its link and its scan."""

    def __init__(self, edge, folder):
        self.editor = Editor()
        self.editor.size = (800.0, 500.0)
        self.perform = PerformSession(self.editor, folder)
        self.perform.connect(str(edge.outlet.publisher.endpoint))
        self.scan = ScanSession(self.editor, self.perform)

    def poll(self):
        self.perform.advance(0.01)
        self.scan.advance()

    def close(self):
        self.perform.disconnect()


class Begun:
    """Reports if a window's scan has started; repeats the request if the edge did not receive it."""

    def __init__(self, scan):
        self.scan, self.asked = scan, -ASKED_EVERY

    def __call__(self):
        if self.scan.message.phase != "scanning" and time.monotonic() - self.asked > ASKED_EVERY:
            self.asked = time.monotonic()
            self.scan.start()
        return self.scan.message.phase == "scanning"
