"""Runs programs as ordinary users of the guest machine, and reads their output."""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

SEATED, HELPER, STRANGER = "performer", "helper", "stranger"
"""The user of the first screen's session, a member of the group plugdev, and a user that is neither."""
SLOW = 180.0
"""Timeout for actions of an emulated processor, seconds."""


def command(user: str, *words: str) -> list[str]:
    """Returns the command line that runs a command as a user, with the environment of the tests."""
    return ["runuser", "-u", user, "--", "env", f"HOME=/home/{user}", *words]


def answer(user: str, script: str) -> Any:
    """Returns the JSON output of a Python script run by a user."""
    done = subprocess.run(
        command(user, sys.executable, "-c", script), capture_output=True, text=True, timeout=SLOW
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


class Listener:
    """The controls of :mod:`listener`, run by the user that is logged in at the machine."""

    def __init__(self, settings: dict[str, dict[str, Any]]) -> None:
        folder = Path(tempfile.mkdtemp(prefix="listener-"))
        os.chmod(folder, 0o755)
        self._wanted = folder / "controls.json"
        self._wanted.write_text(json.dumps(settings))
        self._log = (folder / "log").open("w")
        program = str(Path(__file__).with_name("listener.py"))
        words = command(SEATED, sys.executable, program, str(self._wanted))
        self._process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=self._log, text=True)
        self._lines: queue.Queue[list[Any]] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        self.there: set[str] = set()
        self.words: list[tuple[float, str, str]] = []
        self.holds: tuple[int, int, float] = (0, 0, 0.0)
        self.until(lambda: self.ended or self._uid is not None, "the listener")

    _uid: int | None = None
    ended = False

    def until(self, done: Any, what: str, seconds: float = SLOW) -> None:
        """Reads its output until a condition is true."""
        deadline = time.monotonic() + seconds
        self.take()
        while not done():
            assert self._process.poll() is None, self.log[-2000:]
            assert time.monotonic() < deadline, (
                f"{what} did not come to be in {seconds} s; {self.log[-2000:]}"
            )
            time.sleep(0.01)
            self.take()

    def take(self) -> None:
        while not self._lines.empty():
            at, event, *rest = self._lines.get()
            match event:
                case "listens":
                    (self._uid,) = rest
                case "there":
                    self.there.add(rest[0])
                case "gone":
                    self.there.discard(rest[0])
                case "word":
                    self.words.append((at, rest[0], rest[1]))
                case "holds":
                    self.holds = tuple(rest)
                case "ended":
                    self.ended = True

    @property
    def said(self) -> list[str]:
        return [word for _, _, word in self.words]

    @property
    def log(self) -> str:
        return Path(self._log.name).read_text()

    def count(self) -> tuple[int, int]:
        """Returns its current number of open files and threads."""
        for _ in range(2):
            before = self.holds
            self.until(lambda: self.holds != before, "a new count")  # noqa: B023
        return self.holds[0], self.holds[1]

    def __enter__(self) -> Listener:
        return self

    def __exit__(self, *_: object) -> None:
        """Ends it. It must exit by itself."""
        self._wanted.unlink()
        try:
            assert self._process.wait(SLOW) == 0, self.log[-2000:]
        finally:
            self._process.kill()
            self._log.close()

    def _read(self) -> None:
        for line in self._process.stdout:
            self._lines.put(json.loads(line))
