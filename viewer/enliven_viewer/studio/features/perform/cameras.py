"""Lists the cameras of this machine with the edge's program, and takes test images."""

from __future__ import annotations

import logging
import subprocess
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import IO

import msgspec
import numpy as np
from PIL import Image

from enliven.arrays import UInt8
from enliven.commands.processes import start_process
from enliven.files import DECODE_ERRORS
from enliven_viewer.language import later, tr

log = logging.getLogger(__name__)

_TEST_DURATION_S = "0.6"
"""Duration in seconds of a test. It is enough for some images and for measuring the frame rate."""
_MAX_ANSWER_BYTES = 1 << 20
"""Maximum number of bytes read from the program's output: enough for a thousand cameras."""
_MISSING_EDGE = later(
    "The camera program is not installed here, so this window can only use cameras on other computers."
)


class Camera(msgspec.Struct, frozen=True):
    """A camera as ``enliven sensors --json`` lists it.

    Attributes:
        title: name shown to people.
        sensor: name of the driver; empty if there is none.
        options: options of the driver.
        trouble, remedy: the reason why it cannot be used, and advice; empty if it can be used.
        hint: a note about a camera that can be used; or empty.
        depth: True if it measures depth, which test images need.
    """

    title: str
    sensor: str = ""
    options: dict[str, str] = {}
    trouble: str = ""
    remedy: str = ""
    hint: str = ""
    depth: bool = True

    @property
    def words(self) -> tuple[str, ...]:
        """Returns the arguments of ``enliven edge`` that start this camera."""
        settings = (word for name, value in self.options.items() for word in ("--set", f"{name}={value}"))
        return "--sensor", self.sensor, *settings

    @property
    def can_start(self) -> bool:
        """Returns True if it can be used."""
        return bool(self.sensor) and not self.trouble


class CameraSearch:
    """A background search for cameras, with test images of one of them. It never blocks the window.

    Attributes:
        cameras: the result of the last search; None before the first search has ended.
        problem: the reason why the search failed, or empty.
        test_result: the last tested camera, and a sentence about the result.
        picture: (H, W, 3) sRGB of the last test's depth image; None before the first image.
        number: number of test images so far, so that a panel can detect a new image.
    """

    def __init__(self) -> None:
        self.cameras: tuple[Camera, ...] | None = None
        self.problem = ""
        self.test_result: tuple[Camera, str] | None = None
        self.picture: UInt8 | None = None
        self.number = 0
        self._search: tuple[subprocess.Popen[bytes], IO[str]] | None = None
        self._search_process: tuple[subprocess.Popen[bytes], IO[str], Camera, Path] | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    @property
    def is_searching(self) -> bool:
        """Returns True if a search is running."""
        return self._search is not None

    @property
    def tested_camera(self) -> Camera | None:
        """Returns the camera that is being tested, or None if no test is running."""
        return None if self._search_process is None else self._search_process[2]

    def begin(self) -> None:
        """Starts a search unless one is already running."""
        if self._search is not None:
            return
        if find_spec("enliven_edge") is None:
            self.cameras, self.problem = (), _MISSING_EDGE
            return
        out = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115, it is read when the search ends
        self._search = start_process(["sensors", "--json"], stdout=out), out

    def take_test_image(self, camera: Camera) -> None:
        """Takes a test image of a depth camera."""
        if self._search_process is not None or not camera.can_start:
            return
        self._folder = self._folder or tempfile.TemporaryDirectory(prefix="enliven-look-")
        path = Path(self._folder.name) / "depth.png"
        path.unlink(missing_ok=True)
        output = tempfile.TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115, it is read when the look ends
        _, sensor, *settings = camera.words
        arguments = [
            "sensors",
            sensor,
            *settings,
            "-o",
            str(path),
            "--seconds",
            _TEST_DURATION_S,
            "--picture",
            "none",
        ]
        self._search_process = start_process(arguments, stderr=output, stdout=output), output, camera, path

    def poll(self) -> None:
        """Fetches the results of finished searches and tests. Call once per frame."""
        if self._search is not None and self._search[0].poll() is not None:
            (process, out), self._search = self._search, None
            self.handle_search(_read_and_close(out), bool(process.returncode))
        if self._search_process is not None and self._search_process[0].poll() is not None:
            (process, output, camera, path), self._search_process = self._search_process, None
            self.handle_test(camera, _read_and_close(output), path, bool(process.returncode))

    def close(self) -> None:
        """Ends search and test, and removes their files."""
        for process in [
            running[0] for running in (self._search, self._search_process) if running is not None
        ]:
            process.kill()
            process.wait()
        self._search = self._search_process = None
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

    def handle_search(self, text: str, failed: bool) -> None:
        """Reads the list from the last line of the edge's output."""
        try:
            self.cameras = tuple(msgspec.json.decode(text.strip().splitlines()[-1], type=list[Camera]))
            self.problem = ""
        except (IndexError, *DECODE_ERRORS):
            log.debug("cameras: %r", text[-400:])
            self.cameras = ()
            self.problem = (
                tr("The cameras could not be listed. Run this in a terminal: enliven doctor")
                if failed
                else ""
            )

    def handle_test(self, camera: Camera, output: str, path: Path, failed: bool) -> None:
        """Stores the image of a test, or the error."""
        lines = [line.strip() for line in output.splitlines() if line.strip()]
        if failed or not path.is_file():
            why = (lines or [tr("the camera sent no picture")])[-1].removeprefix("enliven: ")
            self.test_result, self.picture = (camera, why), None
            return
        try:
            with Image.open(path) as image:
                self.picture = np.asarray(image.convert("RGB"), np.uint8)
        except (OSError, ValueError):
            self.test_result, self.picture = (camera, tr("the camera's picture could not be read")), None
            return
        self.number += 1
        self.test_result = (camera, tr("Bright is near, dark is far."))


def _read_and_close(file: IO[str]) -> str:
    """Returns what a process has written into a file, and closes the file."""
    file.seek(0)
    with file:
        return file.read(_MAX_ANSWER_BYTES)
