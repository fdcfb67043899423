"""Person tracking for depth recordings opened in the studio, with ``enliven track`` in the background."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections import deque
from pathlib import Path

from enliven.errors import EnlivenError, InputError
from enliven.files import TemporaryFolder
from enliven.motion_clips.tracked_people import read_recorded_clips
from enliven.recording import DEPTH_TOPIC, Recording
from enliven.wire import BODIES, POSE
from enliven_viewer.language import tr
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.workspace.files import add_file

_MAX_OUTPUT_LINES = 20
"""Maximum number of stored output lines of the tracker. After a failure, the last line contains
the reason.
"""


def lacks_tracking(path: Path) -> bool:
    """Returns True if a file is a depth recording without tracked bodies.

    Raises:
        InputError: if the file cannot be read as a recording.
    """
    if path.suffix.lower() != ".mcap":
        return False
    topics = Recording(path).info.topics
    return DEPTH_TOPIC in topics and not any(topic.name in topics for topic in (BODIES, POSE))


class DepthTracking:
    """A run of the tracker in a separate process. Its results become takes of the project.

    Attributes:
        name: name of the tracked file; empty if no tracker runs.
        share: finished fraction of the file, from 0 to 1.
    """

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
        self.name, self.share = "", 0.0
        self._process: subprocess.Popen[str] | None = None
        self._folder: TemporaryFolder | None = None
        self._output_lines: deque[str] = deque(maxlen=_MAX_OUTPUT_LINES)
        self._reader: threading.Thread | None = None

    @property
    def busy(self) -> bool:
        """Returns True if the tracker is running."""
        return self._process is not None

    def begin(self, path: Path) -> None:
        """Starts tracking a recording in the background.

        Raises:
            InputError: if another recording is still being tracked.
        """
        if self.busy:
            remedy = tr("Wait until the tracking is done, or stop it.")
            raise InputError(tr("{0} is still being tracked", self.name), where=str(path), remedy=remedy)
        self._folder = TemporaryFolder("tracking")
        output = Path(self._folder.name) / path.name
        arguments = [sys.executable, "-m", "enliven", "track", str(path), "-o", str(output), "--lines"]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(arguments, stdout=pipe, stderr=subprocess.STDOUT, text=True)
        self.name, self.share = path.name, 0.0
        self._output_lines.clear()
        self._reader = threading.Thread(target=self._read_output, args=(self._process,), daemon=True)
        self._reader.start()
        self._editor.toasts.show_message(
            tr("Finding the people in {0} ...", path.name), tr("You can go on working.")
        )

    def poll(self) -> None:
        """Adds the tracked people once the tracker has ended, or shows its error. Call once per frame."""
        if self._process is None or self._process.poll() is None:
            return
        self.finish()

    def finish(self) -> None:
        """Waits until the tracker ends, and adds the tracked people to the project."""
        child, folder, name = self._process, self._folder, self.name
        if child is None or folder is None or self._reader is None:
            return
        child.wait()
        self._reader.join()
        self._process, self._folder, self.name = None, None, ""
        with folder:
            if child.returncode:
                problem = self._output_lines[-1] if self._output_lines else tr("the tracker did not start")
                remedy = tr(
                    "Run this in a terminal to see the reason: enliven track {0} -o bodies.mcap", name
                )
                self._editor.toasts.show_error(InputError(problem, where=name, remedy=remedy))
                return
            output = Path(folder.name) / name
            try:
                read_recorded_clips(output, whole=True)
                add_file(self._editor, output)
            except EnlivenError as error:
                remedy = tr("Check what the camera saw: enliven inspect {0} -o film.mp4", name)
                self._editor.toasts.show_error(InputError(error.what, where=name, remedy=remedy))

    def cancel(self) -> None:
        """Stops the tracker without a change of the project."""
        child, folder = self._process, self._folder
        if child is None or folder is None:
            return
        child.terminate()
        child.wait()
        self._editor.toasts.show_message(tr("{0} is no longer tracked", self.name))
        self._process, self._folder, self.name = None, None, ""
        folder.cleanup()

    def _read_output(self, child: subprocess.Popen[str]) -> None:
        """Reads the tracker's output in a separate thread."""
        assert child.stdout is not None
        for line in child.stdout:
            done_text, slash, total = line.strip().partition(" of ")
            if slash and done_text.isdecimal() and total.isdecimal():
                self.share = int(done_text) / max(int(total), 1)
            elif line.strip():
                self._output_lines.append(line.strip())
