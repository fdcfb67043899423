"""A simulated serial pedal: one end of a pseudo-terminal, which tests can unplug."""

from __future__ import annotations

import os
import tty
from pathlib import Path


class Pedal:
    """A port whose path stays the same when it is unplugged and plugged in again, as in /dev/serial/by-id."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._master = self._slave = -1
        self.plug()

    def plug(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.path.symlink_to(os.ttyname(self._slave))

    def unplug(self) -> None:
        self.path.unlink()
        os.close(self._master)
        os.close(self._slave)
        self._master = -1

    def send(self, data: bytes) -> None:
        os.write(self._master, data)

    def close(self) -> None:
        if self._master >= 0:
            self.unplug()
