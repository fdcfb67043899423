"""What a window does with an edge that scans, without its picture."""

import time

from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.perform import PerformSession
from enliven_viewer.studio.scan import ScanSession

ASKED_EVERY = 20.0
"""Seconds from one request for a scan to the next: a link that was busy is up again."""


class Window:
    """What a window does with the edge: its link, and its scan."""

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
    """Whether a window's scan is under way; it is asked for again where the edge did not hear it."""

    def __init__(self, scan):
        self.scan, self.asked = scan, -ASKED_EVERY

    def __call__(self):
        if self.scan.said.phase != "scanning" and time.monotonic() - self.asked > ASKED_EVERY:
            self.asked = time.monotonic()
            self.scan.start()
        return self.scan.said.phase == "scanning"
